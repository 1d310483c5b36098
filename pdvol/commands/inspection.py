"""What pdvol says of scenes, meshes and runs: terms, sizes, bindings. Everything here returns lines of text."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pdvol.draw.bindings import draw_binding
from pdvol.errors import InputError
from pdvol.export.vtu import write_vtu
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.scene_fields import scene_diagonal
from pdvol.meshes import Outline
from pdvol.meshing.build import build_levels
from pdvol.meshing.readers import read_shape
from pdvol.meshing.tetrahedralise import mean_ratio
from pdvol.runs.scene_file import Shot
from pdvol.scene import (
    Barrier,
    Body,
    Flow,
    Friction,
    Gravity,
    Impulse,
    Load,
    Material,
    NeoHookean,
    Plane,
    PointForce,
    Scene,
    Sequential,
    Still,
    metres,
)
from pdvol.store.folder import require_scene
from pdvol.store.reader import Run, open_run


def modelled(scene: Scene) -> list[str]:
    """What a scene requires and will therefore be modelled, one line each."""
    lines = []
    for body in scene.bodies:
        lines.append(f"body {body.name!r}: {_material(body.material)}")
        for region in body.regions:
            where = (
                f"label {', '.join(map(str, region.labels))}"
                if region.labels
                else f"where {getattr(region.where, '__name__', 'asked')}"
            )
            lines.append(f"body {body.name!r}, {where}: {_material(region.material)}")
    lines += [f"load: {_load(load)}" for load in scene.loads]
    for s in scene.supports:
        until = f", released at {s.release:g} s" if np.isfinite(s.release) else ""
        lines.append(f"support: {_named(s.motion)} on {s.body or 'all bodies'}{until}")
    for o in scene.obstacles:
        moving = "" if isinstance(o.motion, Still) else f", moving ({_named(o.motion)})"
        lines.append(f"obstacle {o.name!r}: {'half-space' if isinstance(o, Plane) else 'rigid surface'}{moving}")
    if _is_plane(scene):
        lines.append("dimension: 2, plane strain (per metre of depth)")
    diagonal = scene_diagonal(scene)
    for c in scene.contact:
        if isinstance(c, Barrier):
            known = _youngs(scene)
            told = len(known) == sum(1 + len(b.regions) for b in scene.bodies)
            kappa = (
                f"{c.stiffness * min(known):.3g} Pa"
                if told
                else f"{c.stiffness:g} of the softest cell's Young's modulus"
            )
            law = (
                f"area-weighted barrier, stiffness {kappa}"
                if c.law == "convergent"
                else f"{c.law} barrier, stiffness chosen at each step's start"
            )
            lines.append(f"contact: {law}, dhat {metres(c.dhat, diagonal):.3g} m")
        elif isinstance(c, Friction):
            lines.append(
                f"friction: mu {c.mu:g}, smooth below {metres(c.eps_v, diagonal):.3g} m/s, lagged {c.iterations}"
                " time(s) a step"
            )
            lines += [f"friction between {one!r} and {other!r}: mu {mu:g}" for one, other, mu in c.pairs]
    if not scene.contact:
        lines.append("contact: none")
    if not any(isinstance(c, Friction) for c in scene.contact):
        lines.append("friction: none")
    lines += [f"where bodies meet at t = 0: {remedy.by} by up to {remedy.limit:g}" for remedy in scene.separate]
    lines.append(f"levels: {scene.levels}" if scene.levels > 1 else "levels: 1, no prolongation")
    lines.append(
        f"time: {scene.steps} steps of {scene.dt:g} s; Newton tolerance {metres(scene.solver.tolerance, diagonal):.3g}"
        f" m/s; scene diagonal {diagonal:.4g} m"
    )
    return lines


def _material(material: Material) -> str:
    number = lambda value: "by position" if callable(value) else f"{value:g}"
    damping = f", damping {number(material.damping)} s" if callable(material.damping) or material.damping else ""
    extra = "".join(f", {name} {number(getattr(material, name))}" for name in material.own_parameters())
    return (
        f"{type(material).__name__}, young {number(material.young)} Pa, poisson {number(material.poisson)}, "
        f"density {number(material.density)} kg/m^3{extra}{damping}"
    )


def _load(load: Load) -> str:
    told = lambda value: "by time" if callable(value) else str(tuple(value))
    on = f" on {load.body}" if getattr(load, "body", "") else ""
    if isinstance(load, Gravity):
        return f"gravity {told(load.acceleration)} m/s^2"
    if isinstance(load, Impulse):
        return f"impulse of {told(load.velocity)} m/s at {load.time:g} s{on}"
    if isinstance(load, Flow):
        u = "by place and time" if callable(load.velocity) else told(load.velocity)
        return f"flow {u} m/s of density {load.density:g} kg/m^3, drag {load.drag:g}{on}"
    return (
        f"force {told(load.force)} N{f' at {tuple(load.at)}' if isinstance(load, PointForce) else ' over a region'}{on}"
    )


def _is_plane(scene: Scene) -> bool:
    shape = scene.bodies[0].shape
    shape = read_shape(shape[0] if isinstance(shape, (tuple, list)) else shape)
    return isinstance(shape, Outline) or shape.vertices.shape[1] == 2


def _youngs(scene: Scene) -> list[float]:
    """Young's moduli that are numbers."""
    materials = [m for body in scene.bodies for m in (body.material, *(region.material for region in body.regions))]
    return [m.young for m in materials if not callable(m.young)]


def _named(motion) -> str:
    if isinstance(motion, Sequential):
        return " then ".join(_named(part) for part in motion.motions)
    return getattr(motion, "__name__", type(motion).__name__.lower())


def describe_level(mesh: LevelMesh, level: int) -> str:
    """Size and quality of one level in one line."""
    line = (
        f"level {level}: {len(mesh.points):,} vertices, {len(mesh.cells):,} cells, {len(np.unique(mesh.boundary)):,} on"
        " the surface, "
    )
    line += f"volume {mesh.volumes.sum():.4g}, smallest cell {mesh.volumes.min():.2g}"
    if mesh.dim == 3:
        quality = mean_ratio(mesh.points, mesh.cells)
        worst = int(np.argmin(quality))
        line += f", worst mean ratio {quality[worst]:.2f} (cell {worst})"
    return line


def describe_prolongation(hierarchy: Hierarchy, level: int) -> str:
    """The binding of a level to the one below it, in one line. Collective."""
    r = hierarchy.prolongation(level).report()
    return (
        f"levels {level - 1} -> {level}: {r['inside']:,} bound inside, {r['ray']:,} by ray, {r['neighbour']:,} by"
        f" neighbour, {r['orphans']:,} orphans; {r['weights_per_point']:.3g} weights a vertex, largest |weight|"
        f" {r['largest_weight']:.3g}, ||P||_F {r['frobenius_norm']:.4g} (sqrt m = {r['sqrt_points']:.4g}), ||P||_2"
        f" {r['two_norm']:.3g}"
    )


def describe_shot(shot: Shot) -> list[str]:
    """`pdvol info SCENE.py`: terms and targets; nothing is meshed."""
    levels = [
        f"level {i}: " + ", ".join(f"{b.name} {b.vertices[i]:,} vertices" for b in shot.scene.bodies if b.vertices)
        for i in range(shot.scene.levels)
    ]
    return [*modelled(shot.scene), *(levels if any(b.vertices for b in shot.scene.bodies) else [])]


def draw_bindings(hierarchy: Hierarchy, out: Path, up: Sequence[float] = (0.0, 1.0, 0.0)) -> None:
    """One picture `binding_<level>.png` of each level but the coarsest, in `out`."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror}") from None
    for level in range(1, len(hierarchy)):
        p = hierarchy.prolongation(level)
        title = f"levels {level - 1} -> {level}, {hierarchy.interpolant}"
        draw_binding(out / f"binding_{level}.png", p.coarse.mesh, p.fine.mesh, p.binding.cells, p.weights, title, up)


def describe_run(path: Path, pictures: Path | None = None) -> list[str]:
    """`pdvol info RUN`: what a run folder holds, and its bindings, drawn into the folder `pictures` if there is one."""
    run = open_run(path)
    info = run.info
    require_scene(path, info)
    lines = [
        f"{info['scene']}: method {info['method']}, dt {run.dt:g} s, {info['steps']} steps, parameters"
        f" {info['parameters'] or 'as in the file'}"
    ]
    lines += info.get("mended", [])
    for level in run.levels:
        log = level.log
        line = (
            f"level {level.index}: {level.info['state']}, {len(level.rest):,} vertices, {max(level.steps - 1, 0)} steps"
        )
        if log:
            line += _spent(path, log)
        if "reason" in level.info:
            line += f"; {level.info['reason']}"
        lines.append(line)
    lines += held_back(run)
    hierarchy = Hierarchy([level.mesh for level in run.levels], MPI.COMM_SELF, info.get("prolongation", "barycentric"))
    if pictures is not None:
        draw_bindings(hierarchy, pictures, info.get("up") or (0.0, 0.0, 1.0))
    return [*lines, *(describe_prolongation(hierarchy, level) for level in range(1, len(hierarchy)))]


def held_back(run: Run) -> list[str]:
    """Where contact held scripted motions back, a line per level; empty where all were carried out."""
    lines = []
    for level in run.levels:
        short = [r for r in level.log if r.get("reached", 1.0) < 1.0]
        if short:
            least = min(short, key=lambda r: r["reached"])
            end = level.log[-1].get("behind", 0.0)
            lines.append(
                f"level {level.index}: contact held scripted motions back in {len(short)} of {len(level.log)} steps,"
                f" first in step {short[0]['step']}; least share of a step {least['reached']:.2g} (step"
                f" {least['step']}), " + (f"{end:.3g} s behind at the end" if end else "caught up at the end")
            )
    return lines


def _spent(path: Path, log: Sequence[dict]) -> str:
    """What a level's steps have cost."""
    try:
        seconds = np.array([float(r["seconds"]["total"]) for r in log])
        newton, contacts, cuts = ([int(r[key]) for r in log] for key in ("newton_iterations", "contacts", "cuts"))
        crossing = [int(r["intersections"]) for r in log if "intersections" in r]
    except (KeyError, TypeError, ValueError) as error:
        mend = "remove that line, the states do not depend on it"
        raise InputError(f"{path / 'log.jsonl'}: a record lacks what pdvol writes ({error}); {mend}") from error
    return (
        f", {seconds.sum():.1f} s ({np.median(seconds):.3g} s a step), Newton {np.mean(newton):.1f} "
        f"(most {max(newton)}), contacts up to {max(contacts)}, cuts {sum(cuts)}"
        + (f", intersections {sum(crossing)} in {sum(c > 0 for c in crossing)} states" if crossing else "")
    )


def describe_metrics(result: dict) -> list[str]:
    """`pdvol metrics`: means over all steps, a line per level; after it, indented, what another run has there."""
    others = {entry["level"]: entry for entry in result.get("against", {}).get("levels", [])}
    apart = {entry["level"]: entry["summary"] for entry in result.get("against", {}).get("between", [])}
    lines = [f"{result['run']}: method {result['method']}, {result['prolongation']} prolongation"]
    if others:
        lines.append(
            f"  against {result['against']['run']}: method {result['against']['method']},"
            f" {result['against']['prolongation']} prolongation"
        )
    for entry in result["levels"]:
        lines.append(f"level {entry['level']}: {_means(entry)}")
        if entry["level"] in others:
            lines.append(f"  against {_means(others[entry['level']])}")
        if "centre_error" in apart.get(entry["level"], {}):
            s = apart[entry["level"]]
            lines.append(
                f"  apart: centre of mass {s['centre_error']['mean']:.3g} m (most {s['centre_error']['largest']:.3g})"
                + (
                    f", distance {s['distance']['mean']:.3g} m (most {s['distance']['largest']:.3g})"
                    if "distance" in s
                    else ""
                )
            )
    notes = [*result["notes"], *result.get("against", {}).get("notes", [])]
    return [*lines, *(f"note: {note}" for note in dict.fromkeys(notes))]


def _means(entry: dict) -> str:
    s = {key: value for key, value in entry["summary"].items() if value}
    parts = [f"{entry['steps']} steps"]
    if "continuity" in s:
        parts.append(
            f"continuity {s['continuity']['mean']:.4g} (median {s['continuity']['median']:.4g}, most"
            f" {s['continuity']['largest']:.3g})"
        )
    if "continuity_error" in s:
        parts.append(
            f"continuity error {s['continuity_error']['mean']:.3g} kg m^2 (most {s['continuity_error']['largest']:.3g})"
        )
    if "consistency" in s:
        parts.append(f"consistency {s['consistency']['mean']:.3g} kg m^2 (most {s['consistency']['largest']:.3g})")
        parts.append(
            f"distance from the level below {s['distance']['mean']:.3g} m (most {s['distance']['largest']:.3g})"
        )
        parts.append(
            f"centre of mass {s['centre_error']['mean']:.3g} m apart (most {s['centre_error']['largest']:.3g})"
        )
        parts.append(f"rank of P {entry['projection']['rank']} of {entry['projection']['columns']}")
    if "jitter" in s:
        parts.append(f"jitter {s['jitter']['mean']:.3g} J (most {s['jitter']['largest']:.3g})")
    return ", ".join(parts)


def write_hierarchy(mesh: Path, targets: tuple[int, ...], out: Path, prolongation: str = "barycentric") -> list[str]:
    """`pdvol hierarchy`: builds a mesh's levels, writes each as VTU with a picture of its binding into `out` and
    reports sizes and bindings.
    """
    scene = Scene(bodies=(Body(mesh, NeoHookean(1e5), targets, name=mesh.stem),), dt=0.01, steps=0)
    meshes = build_levels(scene)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror}") from None
    hierarchy = Hierarchy(meshes, MPI.COMM_SELF, prolongation)
    lines = []
    for level, level_mesh in enumerate(meshes):
        homes = {"home_cell": hierarchy.prolongation(level).binding.cells} if level else {}
        write_vtu(out / f"level_{level}.vtu", level_mesh, homes)
        lines.append(describe_level(level_mesh, level))
    draw_bindings(hierarchy, out)
    return [*lines, *(describe_prolongation(hierarchy, level) for level in range(1, len(hierarchy)))]
