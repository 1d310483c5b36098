"""What STARK is given of a scene of pdvol: level 0 of its bodies, and what holds, carries, turns and rubs them."""

from dataclasses import dataclass

import numpy as np

from benchmarks.common.process import Mistake
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Plane, Rigid, Rotation, Scene, Solid
from pdvol.levels.obstacles import placed_obstacles
from pdvol.scene.motions import Still

REST = Rotation(0.0, (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Given:
    """A scene, in SI units.

    Attributes
    ----------
    meshes : points (n, 3) [m] and cells (m, 4) of each body as placed
    surfaces : vertices (n, 3) [m] and faces (m, 3) of each rigid surface as placed, and its turning
    turned : vertices (k,) of the body that each support holds, and its turning
    planes : at rest
    gravity, mu, eps_v, dhat, tolerance : of the scene [m/s^2, -, m/s, m, m/s]
    """

    meshes: list[tuple[np.ndarray, np.ndarray]]
    surfaces: list[tuple[np.ndarray, np.ndarray, Rotation]]
    turned: list[tuple[np.ndarray, Rotation]]
    planes: list[Plane]
    gravity: tuple[float, ...]
    mu: float
    eps_v: float
    dhat: float
    tolerance: float


def given(scene: Scene) -> Given:
    """Level 0 of a scene.

    Raises
    ------
    Mistake
        The scene has something that STARK is not given.
    """
    meshes = [mesh_of(body) for body in scene.bodies]
    loads = [load for load in scene.loads if isinstance(load, Gravity) and isinstance(load.acceleration, tuple)]
    planes = [plane for plane in scene.obstacles if isinstance(plane, Plane) and plane.motion == Still()]
    rigid = [one for one in scene.obstacles if isinstance(one, Rigid)]
    placed = zip(rigid, placed_obstacles(rigid), strict=True)
    surfaces = [(p.vertices, np.asarray(p.faces, np.int32), turning(one.motion, "a surface")) for one, p in placed]
    held = [np.flatnonzero(support.where(meshes[0][0])).astype(np.int32) for support in scene.supports]
    turned = [(held[k], turning(support.motion, "a support")) for k, support in enumerate(scene.supports)]
    barriers = [one for one in scene.contact if isinstance(one, Barrier)]
    frictions = [one for one in scene.contact if isinstance(one, Friction)] or [Friction(0.0, eps_v=1e-3)]
    lengths = (barriers[0].dhat if barriers else None, frictions[0].eps_v, scene.solver.tolerance)
    for carried, what in (
        (len(loads) == len(scene.loads) <= 1, "a load other than one constant gravity"),
        (len(planes) + len(rigid) == len(scene.obstacles), "an obstacle other than resting planes and surfaces"),
        (len(barriers) == 1, "no contact"),
        (not (scene.attachments or scene.muscles or scene.separate), "attachments, muscles or bodies to move"),
        (scene.integrator == "implicit_euler", f"the integrator {scene.integrator}"),
        ({scene.elements_of(body) for body in scene.bodies} == {"linear"}, "elements that are not linear"),
        (not any(one.triples for one in frictions), "pairs with a friction of their own"),
        (not turned or len(meshes) == 1, "supports, and more than one body"),
        (not any(np.any(motion.centre) for _, motion in turned), "a support whose axis misses the origin"),
        (all(isinstance(value, float) for value in lengths), f"relative lengths among {lengths}"),
    ):
        refuse_unless(carried, what)
    gravity, (dhat, eps_v, tolerance) = loads[0].acceleration if loads else (0.0, 0.0, 0.0), lengths
    return Given(meshes, surfaces, turned, planes, gravity, frictions[0].mu, eps_v, dhat, tolerance)


def refuse_unless(carried: bool, what: str) -> None:
    """Raises Mistake where the scene has what STARK is not given."""
    if not carried:
        raise Mistake(f"the scene has {what}, which STARK is not given; extend benchmarks/stark/shot.py")


def mesh_of(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Points and cells of a Neo-Hookean body as placed."""
    mesh, material = body.shape[0] if isinstance(body.shape, (tuple, list)) else body.shape, body.material
    refuse_unless(isinstance(mesh, Solid), f"a body without a mesh of tetrahedra: {body.name}")
    refuse_unless(type(material) is NeoHookean and body.uniform, f"a body that is not all Neo-Hookean: {body.name}")
    refuse_unless(not (material.keyed or material.damping), f"stiffness in time or damping: {body.name}")
    refuse_unless(isinstance(body.velocity, tuple) and not np.any(body.spin), f"a velocity field: {body.name}")
    refuse_unless(body.start is None, f"a body away from rest: {body.name}")
    return body.placement(mesh.vertices), np.asarray(mesh.cells, dtype=np.int32)


def turning(motion, what: str) -> Rotation:
    """A motion as a rotation without an end."""
    motion = REST if motion == Still() else motion
    refuse_unless(isinstance(motion, Rotation) and not np.isfinite(motion.stop), f"{what} that does other than turn")
    return motion
