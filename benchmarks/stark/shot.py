"""A scene of pdvol as a file that a process without pdvol can read: what STARK is given.

The file is an npz. `points_K` (n, 3) [m] and `cells_K` (m, 4) are the mesh of body K as placed, `turned_K` (k,) the
vertices that support K holds, `surface_K` (n, 3) [m] and `faces_K` (m, 3) rigid surface K as placed. `scene` is JSON
with everything else, in SI units.
"""

import json
from pathlib import Path

import numpy as np

from benchmarks.common.process import Mistake
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Plane, Rigid, Rotation, Scene, Solid, Support
from pdvol.levels.obstacles import placed_obstacles
from pdvol.scene.motions import Still


def write(scene: Scene, path: Path) -> None:
    """Writes level 0 of a scene.

    Raises
    ------
    Mistake
        The scene has something that this file cannot say.
    """
    arrays: dict[str, np.ndarray] = {}
    bodies = [body_of(body, index, arrays) for index, body in enumerate(scene.bodies)]
    turns = [turn_of(support, index, scene, arrays) for index, support in enumerate(scene.supports)]
    loads = [load for load in scene.loads if isinstance(load, Gravity) and isinstance(load.acceleration, tuple)]
    planes = [plane for plane in scene.obstacles if isinstance(plane, Plane) and plane.motion == Still()]
    surfaces = [one for one in scene.obstacles if isinstance(one, Rigid)]
    rigid = [surface_of(one, index, arrays) for index, one in enumerate(surfaces)]
    barriers = [one for one in scene.contact if isinstance(one, Barrier)]
    frictions = [one for one in scene.contact if isinstance(one, Friction)]
    refuse_unless(len(loads) == len(scene.loads) <= 1, "a load other than one constant gravity")
    refuse_unless(
        len(planes) + len(rigid) == len(scene.obstacles), "an obstacle other than resting planes and surfaces"
    )
    refuse_unless(len(barriers) == 1, "no contact")
    refuse_unless(not (scene.attachments or scene.muscles or scene.separate), "attachments, muscles or bodies to move")
    refuse_unless(scene.integrator == "implicit_euler", f"the integrator {scene.integrator}")
    refuse_unless({scene.elements_of(body) for body in scene.bodies} == {"linear"}, "elements that are not linear")
    refuse_unless(not any(one.triples for one in frictions), "pairs with a friction of their own")
    lengths = {
        "dhat": barriers[0].dhat,
        "eps_v": frictions[0].eps_v if frictions else 1e-3,
        "tolerance": scene.solver.tolerance,
    }
    refuse_unless(all(isinstance(value, float) for value in lengths.values()), f"relative lengths among {lengths}")
    described = {
        "dt": scene.dt,
        "steps": scene.steps,
        "gravity": list(loads[0].acceleration) if loads else [0.0, 0.0, 0.0],
        "mu": frictions[0].mu if frictions else 0.0,
        **lengths,
        "bodies": bodies,
        "turns": turns,
        "surfaces": rigid,
        "planes": [{"point": list(plane.point), "normal": list(plane.normal)} for plane in planes],
    }
    np.savez(path, scene=np.array(json.dumps(described)), **arrays)


def refuse_unless(carried: bool, what: str) -> None:
    """Raises Mistake where the scene has what STARK is not given."""
    if not carried:
        raise Mistake(f"the scene has {what}, which STARK is not given; extend benchmarks/stark/shot.py")


def body_of(body: Body, index: int, arrays: dict[str, np.ndarray]) -> dict:
    """What a body is made of and how fast it is; its mesh goes into `arrays`."""
    mesh, material = body.shape[0] if isinstance(body.shape, (tuple, list)) else body.shape, body.material
    refuse_unless(isinstance(mesh, Solid), f"a body without a mesh of tetrahedra: {body.name}")
    refuse_unless(type(material) is NeoHookean and body.uniform, f"a body that is not all Neo-Hookean: {body.name}")
    refuse_unless(not (material.keyed or material.damping), f"stiffness in time or damping: {body.name}")
    refuse_unless(isinstance(body.velocity, tuple) and not np.any(body.spin), f"a velocity field: {body.name}")
    refuse_unless(body.start is None, f"a body away from rest: {body.name}")
    arrays[f"points_{index}"] = body.placement(mesh.vertices)
    arrays[f"cells_{index}"] = np.asarray(mesh.cells, dtype=np.int32)
    return {
        "young": material.young,
        "poisson": material.poisson,
        "density": material.density,
        "velocity": list(body.velocity) or [0.0, 0.0, 0.0],
    }


def surface_of(obstacle: Rigid, index: int, arrays: dict[str, np.ndarray]) -> dict:
    """The turning of a rigid surface about an axis through its centre; the surface goes into `arrays`."""
    motion = Rotation(0.0, (0.0, 0.0, 0.0)) if obstacle.motion == Still() else obstacle.motion
    refuse_unless(isinstance(motion, Rotation) and not np.isfinite(motion.stop), "a surface that does other than turn")
    (placed,) = placed_obstacles([obstacle])
    arrays[f"surface_{index}"], arrays[f"faces_{index}"] = placed.vertices, np.asarray(placed.faces, dtype=np.int32)
    return {"speed": motion.speed, "axis": list(motion.axis), "centre": list(motion.centre)}


def turn_of(support: Support, index: int, scene: Scene, arrays: dict[str, np.ndarray]) -> dict:
    """The turning of a support's vertices about an axis through the origin; they go into `arrays`."""
    motion = support.motion
    refuse_unless(len(scene.bodies) == 1, "supports, and more than one body")
    refuse_unless(
        isinstance(motion, Rotation) and not np.any(motion.centre) and not np.isfinite(motion.stop),
        "a support that does other than turn about an axis through the origin",
    )
    arrays[f"turned_{index}"] = np.flatnonzero(support.where(arrays["points_0"])).astype(np.int32)
    return {"speed": motion.speed, "axis": list(motion.axis)}
