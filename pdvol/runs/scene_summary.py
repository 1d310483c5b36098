"""What a scene models, as lines of text. Nothing is meshed, and only shapes that are files are read."""

from pathlib import Path

import numpy as np

from pdvol.levels.scene_fields import scene_diagonal
from pdvol.meshes import Outline
from pdvol.meshing.readers import read_shape
from pdvol.registry import ELEMENTS, INTEGRATORS
from pdvol.runs.scene_file import Shot
from pdvol.scene import (
    Attachment,
    Barrier,
    Body,
    Deforming,
    Flow,
    Friction,
    Gravity,
    Impulse,
    Keyed,
    Load,
    Material,
    Motion,
    Muscle,
    Pascal,
    Plane,
    PointCache,
    PointForce,
    Posed,
    Pressure,
    Scene,
    Sequential,
    metres,
    stands,
)


def scene_summary(shot: Shot) -> list[str]:
    """The terms that will be modelled, and the wanted vertices of each level; raises as `modelled_terms`."""
    levels = [
        f"level {i}: " + ", ".join(f"{b.name} {b.vertices[i]:,} vertices" for b in shot.scene.bodies if b.vertices)
        for i in range(shot.scene.levels)
    ]
    return [*modelled_terms(shot.scene), *(levels if any(b.vertices for b in shot.scene.bodies) else [])]


def modelled_terms(scene: Scene) -> list[str]:
    """One line for each part of the model: materials, loads, contact, levels, time.

    Raises
    ------
    InputError
        A file of a shape is missing or cannot be read.
    """
    lines = [line for body in scene.bodies for line in _body(scene, body)]
    lines += [f"load: {_load(load)}" for load in scene.loads]
    lines += [_muscle(muscle) for muscle in scene.muscles]
    lines += [_attachment(attachment) for attachment in scene.attachments]
    lines += [f"pull: {p.body!r} at {p.where}, from {p.times[0]:g} to {p.times[-1]:g} s" for p in scene.pulls]
    lines += [f"hand: {scene.hand.steps} steps"] if scene.hand else []
    for s in scene.supports:
        until = f", released at {s.release:g} s" if np.isfinite(s.release) else ""
        lines.append(f"support: {_named(s.motion)} on {s.body or 'all bodies'}{until}")
    for o in scene.obstacles:
        moving = "" if stands(o.motion) else f", moving ({_named(o.motion)})"
        surface = f"{'deforming' if isinstance(o, Deforming) else 'rigid'} surface"
        lines.append(f"obstacle {o.name!r}: {'half-space' if isinstance(o, Plane) else surface}{moving}")
    if _is_plane(scene):
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
    number = lambda value: "by time" if isinstance(value, Keyed) else "by position" if callable(value) else f"{value:g}"
    damping = f", damping {number(material.damping)} s" if callable(material.damping) or material.damping else ""
    extra = "".join(f", {name} {number(getattr(material, name))}" for name in material.own_parameters())
    return (
        f"{type(material).__name__}, young {number(material.young)} Pa, poisson {number(material.poisson)}, "
        f"density {number(material.density)} kg/m^3{extra}{damping}"
    )


def _load(load: Load) -> str:
    shown = lambda value: "by time" if callable(value) else str(tuple(value))
    if isinstance(load, Gravity):
        return f"gravity {shown(load.acceleration)} m/s^2"
    on = f" on {load.body}" if load.body else ""
    if isinstance(load, Impulse):
        return f"impulse of {shown(load.velocity)} m/s at {load.time:g} s{on}"
    if isinstance(load, Pressure):
        return f"pressure {'by time' if callable(load.pressure) else f'{load.pressure:g}'} Pa in {load.body}"
    if isinstance(load, Flow):
        by_place = callable(load.velocity) and not isinstance(load.velocity, Keyed)
        u = "by place and time" if by_place else shown(load.velocity)
        return f"flow {u} m/s of density {load.density:g} kg/m^3, drag {load.drag:g}{on}"
    where = f"at {tuple(load.at)}" if isinstance(load, PointForce) else "over a region"
    return f"force {shown(load.force)} N {where}{on}"


def _muscle(muscle: Muscle) -> str:
    fibre = "by position" if callable(muscle.fibre) else str(tuple(muscle.fibre))
    given = muscle.activation
    activation = "by time" if isinstance(given, Keyed) else "by time and place" if callable(given) else f"{given:g}"
    return f"muscle: {muscle.body!r} along {fibre}, {muscle.strength:g} Pa, activation {activation}"


def _attachment(attachment: Attachment) -> str:
    length = "" if attachment.rest_length is None else f", rest length {attachment.rest_length:g} m"
    breaking = "never breaks" if attachment.breaking is None else f"breaks at {attachment.breaking:g} N"
    ends = f"{attachment.body!r} to {attachment.other!r}"
    return f"attachment: {ends}, {attachment.stiffness:g} N/m in all{length}, {breaking}"


def _is_plane(scene: Scene) -> bool:
    shape = scene.bodies[0].shape
    shape = read_shape(shape[0] if isinstance(shape, (tuple, list)) else shape)
    return isinstance(shape, Outline) or shape.vertices.shape[1] == 2


def _named(motion: Motion | PointCache) -> str:
    if isinstance(motion, PointCache):
        return motion.label
    if isinstance(motion, Sequential):
        return " then ".join(_named(part) for part in motion.motions)
    return getattr(motion, "__name__", type(motion).__name__.lower())
