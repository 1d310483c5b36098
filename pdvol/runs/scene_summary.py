"""What a scene models, as lines of text. Nothing is meshed, and only shapes that are files are read."""

from pathlib import Path

from pdvol.levels.function_check import shape_points
from pdvol.levels.scene_fields import scene_diagonal
from pdvol.registry import ELEMENTS, INTEGRATORS
from pdvol.runs.scene_file import Shot
from pdvol.scene import Barrier, Body, Friction, Keyed, Material, Pascal, Posed, Scene, metres


def scene_summary(shot: Shot) -> list[str]:
    """The terms that will be modelled, and the wanted vertices of each level; raises as `modelled_terms`."""
    levels = [
        f"level {i}: " + ", ".join(f"{b.name} {b.vertices[i]:,} vertices" for b in shot.scene.bodies if b.vertices)
        for i in range(shot.scene.levels)
    ]
    return [*modelled_terms(shot.scene), *(levels if any(b.vertices for b in shot.scene.bodies) else [])]


def modelled_terms(scene: Scene) -> list[str]:
    """One line for each part of the model: materials, loads and what else is written in the scene, contact, levels,
    time.

    Raises
    ------
    InputError
        A file of a shape is missing or cannot be read.
    """
    lines = [line for body in scene.bodies for line in _body(scene, body)]
    for kind in ("load", "muscle", "attachment", "pull", "support", "obstacle"):
        lines += [f"{kind}: {element}" for element in getattr(scene, f"{kind}s")]
    lines += [f"hand: {scene.hand.steps} steps"] if scene.hand else []
    if shape_points(scene.bodies[0]).shape[1] == 2:
        lines.append("dimension: 2, plane strain (per metre of depth)")
    diagonal = scene_diagonal(scene)
    lines += _contact(scene, diagonal)
    lines += [f"where bodies meet at t = 0: {remedy.by} by up to {remedy.limit:g}" for remedy in scene.separate]
    if scene.integrator != next(iter(INTEGRATORS)):
        lines.append(f"integrator: {scene.integrator}")
    lines.append(f"model: {scene.model}")
    lines.append(f"levels: {scene.levels}" if scene.levels > 1 else "levels: 1, no prolongation")
    lines.append(
        f"time: {scene.steps} steps of {scene.dt:g} s; Newton tolerance {metres(scene.solver.tolerance, diagonal):.3g}"
        f" m/s; diagonal of the smallest free body {diagonal:.4g} m"
    )
    return lines


def _body(scene: Scene, body: Body) -> list[str]:
    kind = scene.elements_of(body)
    elements = "" if kind == ELEMENTS[0] else f", {kind} elements"
    lines = [f"body {body.name!r}: {_material(body.material)}{elements}"]
    for region in body.regions:
        labels, function = ", ".join(map(str, region.labels)), getattr(region.where, "__name__", "chosen")
        where = f"label {labels}" if region.labels else f"where {function}"
        lines.append(f"body {body.name!r}, {where}: {_material(region.material)}")
    if body.start is not None:
        given = getattr(body.start, "__name__", type(body.start).__name__)
        leads = "a posed mesh" if isinstance(body.start, Posed) else given
        lines.append(f"body {body.name!r}: starts away from rest, where {leads} leads it")
    for mesh in body.render_meshes:
        what = Path(mesh.shape).name if isinstance(mesh.shape, (str, Path)) else repr(mesh.shape)
        lines.append(f"body {body.name!r}: drawn as {what}, carried by {mesh.interpolant} weights")
    return lines


def _contact(scene: Scene, diagonal: float) -> list[str]:
    lines = []
    for c in scene.contact:
        if isinstance(c, Barrier):
            materials = [m for b in scene.bodies for m in (b.material, *(region.material for region in b.regions))]
            known = [m.young for m in materials if not callable(m.young)]
            kappa = f"{c.stiffness:g} of the softest cell's Young's modulus"
            if len(known) == len(materials) or isinstance(c.stiffness, Pascal):
                kappa = f"{c.kappa(min(known, default=0.0)):.3g} Pa"
            lines.append(f"contact: area-weighted barrier, stiffness {kappa}, dhat {metres(c.dhat, diagonal):.3g} m")
        elif isinstance(c, Friction):
            smooth = f"smooth below {metres(c.eps_v, diagonal):.3g} m/s"
            lines.append(f"friction: mu {c.mu:g}, {smooth}, lagged {c.iterations} time(s) a step")
            lines += [f"friction between {one!r} and {other!r}: mu {mu:g}" for one, other, mu in c.triples]
    if not scene.contact:
        lines.append("contact: none")
    if not any(isinstance(c, Friction) for c in scene.contact):
        lines.append("friction: none")
    return lines


def _material(material: Material) -> str:
    plain = lambda value: " ".join(f"{part:g}" for part in (value if isinstance(value, tuple) else (value,)))
    number = lambda value: "by time" if isinstance(value, Keyed) else "by position" if callable(value) else plain(value)
    damping = f", damping {number(material.damping)} s" if callable(material.damping) or material.damping else ""
    extra = "".join(f", {name} {number(getattr(material, name))}" for name in material.own_parameters())
    return (
        f"{type(material).__name__}, young {number(material.young)} Pa, poisson {number(material.poisson)}, "
        f"density {number(material.density)} kg/m^3{extra}{damping}"
    )
