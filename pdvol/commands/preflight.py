"""`pdvol check`: what would stop or spoil a run, found before it starts; as plain data, which is told in lines or
written as JSON.

The cost of a level is that of level 0, measured by simulating its beginning for some seconds without storing anything,
times ((n + A) / (n_0 + A))^1.05 for n vertices: a Newton iteration costs so from 4,000 to 100,000 vertices
(docs/benchmarks.md), and A vertices' worth whatever the size. The number of iterations a step is taken to be level 0's.
Meshing and start-up are not counted.
"""

import os
import resource
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pdvol.commands.inspection import modelled
from pdvol.errors import InputError, IntersectionError, SimulationError
from pdvol.export.vtu import write_primitives, write_vtu
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.integrate.marches import Start, direct
from pdvol.integrate.stepper import Stepper
from pdvol.levels.initial_state import Defect, find_defects, smallest_gap
from pdvol.levels.materials import cell_materials
from pdvol.levels.model import level_model
from pdvol.levels.obstacles import scene_obstacles
from pdvol.levels.scene_fields import check_fields, initial_velocity, scene_diagonal
from pdvol.levels.separation import build_apart
from pdvol.levels.space import LevelSpace
from pdvol.meshes import Outline, Solid
from pdvol.meshing.build import build_levels
from pdvol.meshing.readers import read_shape
from pdvol.meshing.tetrahedralise import mean_ratio
from pdvol.meshing.validate import check_outline, check_solid, check_surface
from pdvol.scene import Barrier, Scene, metres
from pdvol.store.files import write_json

WORST = 5  # cells named
POOR = 0.05  # mean ratio below which a cell slows the linear solver: a note
NEAR = 10.0  # of dhat: gaps are told up to there
STIFF = 1e4  # ratio of Young's moduli from which a note is made
GROWTH = 1.05
OVERHEAD = {2: 600, 3: 100}  # vertices: A above, from levels of 100 to 20,000 vertices
KILOBYTES = {
    2: 2.0,
    3: 7.1,
}  # per vertex, of systems with a coarse space; measured at 90,601 (2D) and 99,900 vertices (3D)


def check_scene(scene: Scene, seconds: float = 3.0, out: Path | None = None) -> dict:
    """Everything known of a scene before it runs.

    Parameters
    ----------
    scene : Scene
    seconds : how long level 0 may be simulated to tell what levels cost; 0: not at all
    out : folder for `level_<l>.vtu` (cells' `quality`; points' `defect`) and `defects_<l>.vtu` (the primitives at
        fault); none is written if None

    Returns
    -------
    dict
        `sound`, `modelled` (lines), `stiffness_ratio`, `levels` (sizes, worst cells, smallest gap, defects, cost),
        `notes` and `defects` (lines).
    """
    result = {"sound": False, "modelled": [], "stiffness_ratio": None, "levels": [], "notes": [], "defects": []}
    try:
        result["modelled"] = modelled(scene)
        obstacles = scene_obstacles(scene)
        meshes = _levels(scene, obstacles, result["notes"])
    except InputError as error:
        return {**result, "defects": [f"defect: {error}"]}
    diagonal = scene_diagonal(scene)
    with suppress(InputError):  # told with the fields of level 0
        young = cell_materials(scene, meshes[0]).young
        result["stiffness_ratio"] = float(young.max() / young.min())
    drawn = []
    for level, mesh in enumerate(meshes):
        entry, found = _check_level(scene, mesh, level, obstacles, diagonal)
        result["levels"].append(entry)
        result["defects"] += [f"defect at level {level}: {message}" for message in entry["defects"]]
        drawn.append(found)
    if out is not None:
        _draw(out, meshes, drawn)
    result["sound"] = not result["defects"]
    if result["sound"] and seconds > 0 and scene.steps:
        _estimate(result, scene, meshes, obstacles, diagonal, seconds)
    _note(result)
    return result


def _levels(scene: Scene, obstacles, notes: list[str]) -> Sequence[LevelMesh]:
    """The levels, with bodies set apart where the scene asks for it; as they are where that is not enough."""
    try:
        meshes, mended = build_apart(scene, scene.levels, obstacles)
        notes += [f"note: {line}" for line in mended]
        return meshes
    except IntersectionError as error:
        notes.append(f"note: bodies could not be set apart: {error}")
        return build_levels(scene)


def _check_level(scene: Scene, mesh: LevelMesh, level: int, obstacles, diagonal: float) -> tuple[dict, list[Defect]]:
    quality = mean_ratio(mesh.points, mesh.cells)
    worst = np.argsort(quality, kind="stable")[:WORST]
    edge = _shortest_edge(mesh)
    entry = {
        "level": level,
        "vertices": len(mesh.points),
        "cells": len(mesh.cells),
        "surface_vertices": len(np.unique(mesh.boundary)),
        "volume": float(mesh.volumes.sum()),
        "smallest_cell": float(mesh.volumes.min()),
        "shortest_edge": edge,
        "worst_cells": [
            {"cell": int(c), "body": scene.bodies[mesh.bodies[c]].name, "quality": float(quality[c])} for c in worst
        ],
        "poor_cells": int((quality < POOR).sum()),
        "smallest_gap": None,
        "near_pairs": 0,
        "defects": [],
        "edges_per_step": None,
    }
    defects: list[Defect] = []
    names = [body.name for body in scene.bodies]
    try:
        check_fields(scene, mesh, level)
        speed = float(np.linalg.norm(initial_velocity(scene, mesh), axis=1).max())
        entry["speed"], entry["edges_per_step"] = speed, speed * scene.dt / edge
        if scene.contact:
            defects = list(find_defects(level, mesh, obstacles, names))
            entry["defects"] = [str(d.error) for d in defects]
            if not defects:
                dhat = metres(next(c.dhat for c in scene.contact if isinstance(c, Barrier)), diagonal)
                gap, _ = smallest_gap(mesh, obstacles, names, NEAR * dhat)
                if gap is not None:
                    entry["smallest_gap"] = {
                        "distance": gap.distance,
                        "one": gap.one,
                        "other": gap.other,
                        "dhats": gap.distance / dhat,
                    }
                    entry["near_pairs"] = smallest_gap(mesh, obstacles, names, dhat)[1]
    except InputError as error:
        entry["defects"].append(str(error))
    return entry, defects


def _shortest_edge(mesh: LevelMesh) -> float:
    corners = mesh.points[mesh.cells]
    return float(
        min(np.linalg.norm(corners[:, i] - corners[:, j], axis=1).min() for i in range(mesh.dim + 1) for j in range(i))
    )


def _draw(out: Path, meshes: Sequence[LevelMesh], drawn: Sequence[Sequence[Defect]]) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
        for level, (mesh, defects) in enumerate(zip(meshes, drawn, strict=True)):
            corners = [(corner, number) for number, defect in enumerate(defects, 1) for corner in defect.primitives]
            marks = np.zeros(len(mesh.points), dtype=np.int32)
            if corners:
                places = {tuple(point): i for i, point in enumerate(mesh.points)}
                for corner, number in corners:
                    marks[[places[tuple(point)] for point in corner if tuple(point) in places]] = number
                write_primitives(out / f"defects_{level}.vtu", *zip(*corners, strict=True))
            write_vtu(
                out / f"level_{level}.vtu", mesh, {"defect": marks}, {"quality": mean_ratio(mesh.points, mesh.cells)}
            )
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror}") from None


def _estimate(
    result: dict, scene: Scene, meshes: Sequence[LevelMesh], obstacles, diagonal: float, seconds: float
) -> None:
    """Adds what each level will cost, from the beginning of level 0."""
    mesh, dim = meshes[0], meshes[0].dim
    model = level_model(scene, mesh, 0, diagonal, obstacles)
    stepper = Stepper(model, LevelSpace(mesh, MPI.COMM_SELF))
    begin, spent, iterations = time.perf_counter(), [], []
    try:
        for report in direct(stepper, Start.at_rest(mesh.points, model.velocity), scene.steps):
            spent.append(report.seconds["total"])
            iterations.append(report.newton_iterations)
            if time.perf_counter() - begin > seconds:
                break
    except SimulationError as error:
        result["notes"].append(f"note: level 0 cannot go on: {error}")
    if not spent:
        return
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    step = float(np.mean(spent))
    result["measured"] = {
        "steps": len(spent),
        "seconds_per_step": step,
        "newton_iterations": float(np.mean(iterations)),
    }
    for entry in result["levels"]:
        n, n0, extra = entry["vertices"], len(mesh.points), OVERHEAD[dim]
        entry["seconds_per_step"] = step * ((n + extra) / (n0 + extra)) ** GROWTH
        entry["seconds"] = scene.steps * entry["seconds_per_step"]
        entry["memory_mb"] = used + KILOBYTES[dim] * (n - n0) / 1024


def _note(result: dict) -> None:
    notes = result["notes"]
    for entry in result["levels"]:
        if entry["edges_per_step"] is not None and entry["edges_per_step"] > 1.0:
            fits = entry["shortest_edge"] / entry["speed"]
            notes.append(
                f"note: level {entry['level']}: at {entry['speed']:.3g} m/s a body crosses"
                f" {entry['edges_per_step']:.1f} of its shortest edges per step; contact holds, detail may not (dt ="
                f" {fits:.2g} s crosses one)"
            )
        if entry["poor_cells"]:
            notes.append(
                f"note: level {entry['level']}: {entry['poor_cells']} cells have a mean ratio below {POOR:g}; they slow"
                " the linear solver"
            )
        if entry["near_pairs"]:
            notes.append(
                f"note: level {entry['level']}: {entry['near_pairs']} pairs of primitives are nearer than dhat at t = 0"
                " and push at once"
            )
    if result["stiffness_ratio"] is not None and result["stiffness_ratio"] > STIFF:
        notes.append(
            f"note: stiffness ratio {result['stiffness_ratio']:.1g}; the direct linear solver is the safer choice"
            " (--set linear=direct)"
        )


def told(result: dict) -> list[str]:
    """The result of `check_scene` in lines."""
    lines = list(result["modelled"])
    if result["stiffness_ratio"] not in (None, 1.0):
        lines.append(f"stiffness ratio of the materials: {result['stiffness_ratio']:.3g}")
    for e in result["levels"]:
        lines.append(
            f"level {e['level']}: {e['vertices']:,} vertices, {e['cells']:,} cells, {e['surface_vertices']:,} on the"
            f" surface, volume {e['volume']:.4g}, smallest cell {e['smallest_cell']:.2g}, shortest edge"
            f" {e['shortest_edge']:.3g} m"
        )
        lines.append(
            "  worst cells (mean ratio): "
            + ", ".join(f"{w['cell']} of {w['body']} ({w['quality']:.2f})" for w in e["worst_cells"])
        )
        gap = e["smallest_gap"]
        if gap is not None:
            lines.append(
                f"  smallest gap at t = 0: {gap['distance']:.3g} m, {gap['dhats']:.2g} dhat, between {gap['one']} and"
                f" {gap['other']}"
            )
        if e.get("speed"):
            lines.append(
                f"  fastest vertex at t = 0: {e['speed']:.3g} m/s, {e['edges_per_step']:.2g} shortest edges a step"
            )
        if "seconds" in e:
            lines.append(
                f"  about {_duration(e['seconds'])} ({e['seconds_per_step']:.2g} s a step) and {e['memory_mb']:,.0f} MB"
            )
    if "measured" in result:
        m = result["measured"]
        lines.append(
            f"costs from {m['steps']} steps of level 0: {m['seconds_per_step']:.2g} s and {m['newton_iterations']:.1f}"
            " Newton iterations a step"
        )
    lines += result["notes"] + result["defects"]
    return [
        *lines,
        "sound: nothing found that would stop a run" if result["sound"] else "not sound: mend the defects above",
    ]


def _duration(seconds: float) -> str:
    return (
        f"{seconds:.2g} s"
        if seconds < 60
        else f"{seconds / 60:.2g} min"
        if seconds < 3600
        else f"{seconds / 3600:.2g} h"
    )


def check_meshes(files: Sequence[Path]) -> dict:
    """Each file read and validated: `sound`, and `files` with `file`, `sound` and what there is to tell of it."""
    entries = []
    for file in files:
        try:
            entries.append({"file": str(file), "sound": True, "told": _check_mesh(file)})
        except InputError as error:
            entries.append({"file": str(file), "sound": False, "told": f"defect: {error}"})
    return {"sound": all(entry["sound"] for entry in entries), "files": entries}


def _check_mesh(file: Path) -> str:
    shape = read_shape(file)
    if isinstance(shape, Outline):
        check_outline(shape, str(file))
        return f"{file}: outline of {len(shape.points):,} points, sound"
    if not isinstance(shape, Solid):
        check_surface(shape, str(file))
        return f"{file}: surface of {len(shape.vertices):,} vertices, {len(shape.triangles):,} triangles, sound"
    solid = check_solid(shape, str(file))
    quality = mean_ratio(solid.vertices, solid.cells)
    worst = ", ".join(f"{c} ({quality[c]:.2f})" for c in np.argsort(quality, kind="stable")[:WORST])
    return (
        f"{file}: {len(shape.vertices):,} vertices, {len(shape.cells):,} cells, regions"
        f" {sorted(set(shape.regions.tolist()))}, worst cells (mean ratio) {worst}, sound"
    )


def write_result(result: dict, file: Path) -> None:
    """The result as JSON; InputError where it cannot be written."""
    if file.is_dir() or not os.access(file.parent, os.W_OK):
        raise InputError(f"{file} cannot be written; choose another file in a folder of yours")
    write_json(file, result)
