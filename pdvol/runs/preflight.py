"""What would stop or spoil a run, found before it starts, as plain data.

The cost of a level is estimated from level 0. The beginning of level 0 is simulated for some seconds without storing
anything, and its seconds a step are multiplied by ((n + A) / (n_0 + A))^1.05 for a level of n vertices. This is how the
cost of a Newton iteration grows from 4,000 to 100,000 vertices (docs/benchmarks.md); A vertices stand for the cost that
does not depend on the size. Every level is assumed to need as many iterations a step as level 0. Meshing and start-up
are not counted.
"""

import resource
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from pdvol.errors import InputError, IntersectionError, SimulationError
from pdvol.geometry.level_mesh import LevelMesh, facet_sizes
from pdvol.integrate.marches import Start, direct
from pdvol.integrate.stepper import Stepper
from pdvol.levels.binding import ISLAND, bind
from pdvol.levels.function_check import call_functions
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.initial_state import Defect, buried, smallest_gap
from pdvol.levels.level_check import cells_through, level_defects, level_notes, weight_notes
from pdvol.levels.materials import cell_materials
from pdvol.levels.model import level_model
from pdvol.levels.obstacles import placed_obstacles
from pdvol.levels.scene_fields import chosen_points, initial_velocity, scene_diagonal
from pdvol.levels.space import LevelSpace
from pdvol.levels.start import started
from pdvol.meshing.build import build_levels, vertices_asked
from pdvol.meshing.cpu_budget import cpu_budget
from pdvol.meshing.edge_length import ACCEPTED_DEVIATION
from pdvol.meshing.losses import named
from pdvol.meshing.tetrahedralise import mean_ratio
from pdvol.meshing.verdict import POOR_QUALITY
from pdvol.meshing.vtu import write_primitives, write_vtu
from pdvol.potentials.elasticity import CauchyStress, elastic_terms
from pdvol.runs.render_meshes import render_defects
from pdvol.runs.scene_summary import modelled_terms
from pdvol.runs.separation import build_apart
from pdvol.runs.shape_check import NAMED_CELLS, shape_notes, writable, write_crossings
from pdvol.scene import Barrier, Scene, Support, metres
from pdvol.solve.linear.petsc_methods import check_options
from pdvol.stages import say, stage

SAME_AREA = 1.1
"""Ratio of the areas that a support holds on two levels up to which they are the same part of the shape."""
NO_STRESS = 1e-9  # of Young's modulus: stresses at rest below it are round-off
LONGEST_STEP = 60.0  # s: of the steps that estimate costs; a law without a minimum never ends one
GAP_RANGE = 10.0  # multiples of dhat: larger gaps do not touch in the first steps and are not searched for
HIGH_STIFFNESS_RATIO = 1e4  # of Young's moduli: above it the iterative linear solver may fail
COST_EXPONENT = 1.05  # of the vertices, fitted to benchmarks of 4,000 to 100,000 vertices
COST_OFFSET = {2: 600, 3: 100}  # vertices, by dimension: A above, fitted to levels of 100 to 20,000 vertices
SMOOTHED_OFFSET = 0.6  # times that with smoothed elements, whose work per vertex is larger: 81 to 1,900 vertices
# vertices of a level up to which its binding is looked at: it takes 6 s a hundred thousand
BOUND_VERTICES = 100_000
# Kilobytes a vertex, by dimension, with a coarse space; measured at 90,601 (2D) and 99,900 vertices (3D).
MEMORY_PER_VERTEX = {2: 2.0, 3: 7.1}
SMOOTHED_MEMORY = 1.9  # times that with smoothed elements: 13 kilobytes a vertex at 19,600 vertices in 3D


def check_scene(scene: Scene, seconds: float = 3.0, out: Path | None = None) -> dict:
    """Everything known of a scene before it runs.

    Parameters
    ----------
    seconds : how long level 0 may be simulated to estimate the levels' cost [s]; 0: not at all
    out : folder for `level_<l>.vtu` (at t = 0; cells' `quality`, at rest; points' `defect`) and `defects_<l>.vtu` (the
        primitives of each defect), or for `defects.vtu` where a shape is at fault; none is written if None

    Returns
    -------
    dict
        `sound`, `modelled` (lines), `stiffness_ratio`, `supports` (area of the boundary that each holds on each level
        [m^(d-1)], and its part of its body's), `levels` (sizes, worst cells, smallest gap, defects, cost),
        `notes` and `defects` (lines).
    """
    result: dict[str, Any] = {"sound": False, "modelled": [], "stiffness_ratio": None, "supports": []}
    notes = list[str]()
    result |= {"levels": [], "notes": notes, "defects": []}
    try:
        check_options(scene.solver)
        result["modelled"] = modelled_terms(scene)
        obstacles = placed_obstacles(scene.obstacles)
        call_functions(scene, obstacles)
        with cpu_budget(vertices_asked(scene)):
            notes += shape_notes(scene)
            meshes = _build_levels(scene, obstacles, notes)
    except InputError as error:
        write_crossings(out, [error])
        return {**result, "notes": [f"note: {line}" for line in notes], "defects": [f"defect: {error}"]}
    stopping, lost = render_defects(scene, meshes)
    result["defects"] += [f"defect: {line}" for line in stopping]
    notes += [*lost, *_target_notes(scene, meshes)]
    for one, other in buried(obstacles):
        notes.append(f"{one.label} lies inside {other.label} at t = 0, where no body can reach it")
    diagonal = scene_diagonal(scene)
    with suppress(InputError):  # level 0's check of its fields reports it
        young = cell_materials(scene, meshes[0]).young
        result["stiffness_ratio"] = float(young.max() / young.min())
        notes += weight_notes(scene, meshes[0])
    with suppress(InputError):
        result["supports"] = [_held(scene, support, meshes) for support in scene.supports]
    notes += _support_notes(result["supports"])
    defects = []
    for level, mesh in enumerate(meshes):
        with stage(f"checking level {level}"):
            entry, found = _check_level(scene, meshes, level, obstacles, diagonal)
        result["levels"].append(entry)
        notes += level_notes(scene, mesh, level, diagonal)
        if level and len(mesh.points) <= BOUND_VERTICES:
            notes += _island_notes(scene, meshes[level - 1], mesh, level)
        result["defects"] += [
            f"defect at level {level}: {message.removeprefix(f'level {level}: ')}" for message in entry["defects"]
        ]
        defects.append(found)
    if out is not None:
        _write_levels(out, scene, meshes, defects)
    if not result["defects"]:
        try:
            notes += _stress_notes(scene, meshes[0])
            if seconds > 0 and scene.steps:
                with stage("estimating costs from level 0"):
                    _estimate_costs(result, scene, meshes, obstacles, diagonal, seconds)
        except InputError as error:
            result["defects"].append(f"defect: {error}")
    result["sound"] = not result["defects"]
    notes += _result_notes(result)
    return {**result, "notes": [f"note: {line}" for line in notes]}


def _build_levels(scene: Scene, obstacles: Sequence, notes: list[str]) -> Sequence[LevelMesh]:
    """The levels, with bodies set apart where the scene's `separate` allows it; unchanged where that is not enough."""
    try:
        meshes, mended = build_apart(scene, scene.levels, obstacles)
        notes += mended
        return meshes
    except IntersectionError as error:
        notes.append(f"bodies could not be set apart: {error}")
        return build_levels(scene)


def _target_notes(scene: Scene, meshes: Sequence[LevelMesh]) -> Iterator[str]:
    """A line for each body and level whose number of vertices is not near the one asked for."""
    for level, mesh in enumerate(meshes):
        counts = np.bincount(mesh.point_bodies, minlength=len(scene.bodies))
        for body, count in zip(scene.bodies, counts, strict=True):
            asked = body.vertices[level] if body.vertices else count
            if abs(count / asked - 1.0) > ACCEPTED_DEVIATION:
                yield f"level {level}: body {body.name!r} has {count:,} vertices, asked for {asked:,}: the closest"


def _stress_notes(scene: Scene, mesh: LevelMesh) -> Iterator[str]:
    """A line for each body with a stress at rest, which a law of a user's own may have."""
    materials, stresses = cell_materials(scene, mesh), np.zeros((len(mesh.cells), 3, 3))
    if not all(law.psi.__module__.startswith("pdvol.") for law in materials.laws):
        for _, term in zip(materials.laws, elastic_terms(LevelSpace(mesh, MPI.COMM_SELF), materials), strict=False):
            CauchyStress(term).add_to(stresses, mesh.points)
    sizes = np.abs(stresses[:, : mesh.dim, : mesh.dim]).max(axis=(1, 2))
    for number in np.unique(mesh.bodies[sizes > NO_STRESS * materials.young]):
        cell = np.where(mesh.bodies == number, sizes, 0.0).argmax()
        name, law = scene.bodies[number].name, materials.laws[materials.law[cell]].__name__
        yield f"body {name!r}: {law} has a stress of {sizes[cell]:.3g} Pa at rest, which sets it in motion"


def _held(scene: Scene, support: Support, meshes: Sequence[LevelMesh]) -> dict:
    """What a support holds of its body's boundary on each level: facets with all their corners."""
    areas, wholes, names = [], [], [body.name for body in scene.bodies]
    for mesh in meshes:
        sizes = facet_sizes(mesh.points, mesh.boundary)
        own = [support.body in ("", names[k]) for k in mesh.point_bodies[mesh.boundary[:, 0]]]
        areas.append(float(sizes[chosen_points(scene, support, mesh)[mesh.boundary].all(axis=1)].sum()))
        wholes.append(float(sizes[own].sum()))
    shares = [a / b for a, b in zip(areas, wholes, strict=True)]
    return {"body": support.body, "areas": areas, "shares": shares, "unit": "m" if meshes[0].dim == 2 else "m^2"}


def _support_notes(supports: Sequence[dict]) -> Iterator[str]:
    """A line for each support that holds clearly more of the boundary on one level than on another."""
    for support in supports:
        areas = support["areas"]
        if max(areas) > SAME_AREA * min(areas):
            least, most = int(np.argmin(areas)), int(np.argmax(areas))
            held, unit = support["body"] or "all bodies", support["unit"]
            yield (
                f"a support of {held} holds {areas[least]:.3g} {unit} of the boundary on level {least} and"
                f" {areas[most]:.3g} {unit} on level {most}; let its `where` choose whole faces, or a part that is"
                " wider than the longest edges"
            )


def _island_notes(scene: Scene, coarse: LevelMesh, fine: LevelMesh, level: int) -> Iterator[str]:
    """A line for each body that has vertices in another branch of the coarser level than their neighbours."""
    binding = bind(fine, LevelSpace(coarse, MPI.COMM_SELF))
    islands = np.flatnonzero(binding.kind == ISLAND)
    for number, count in zip(*np.unique(fine.point_bodies[islands], return_counts=True), strict=True):
        first = islands[fine.point_bodies[islands] == number][0]
        yield (
            f"level {level}: {count:,} vertices of body {scene.bodies[number].name!r} (the first is {first}) lie in"
            f" another branch of level {level - 1} than their neighbours, and follow these instead. Level {level - 1}"
            " cuts curves short there: ask for more vertices"
        )


def _check_level(
    scene: Scene, meshes: Sequence[LevelMesh], level: int, obstacles: Sequence, diagonal: float
) -> tuple[dict, list[Defect]]:
    mesh = meshes[level]
    quality = mean_ratio(mesh.points, mesh.cells)
    worst = np.argsort(quality, kind="stable")[:NAMED_CELLS]
    entry: dict[str, Any] = {
        **level_sizes(mesh, level),
        "worst_cells": [
            {"cell": int(c), "body": scene.bodies[mesh.bodies[c]].name, "quality": float(quality[c])} for c in worst
        ],
        "thinnest": [
            {"body": scene.bodies[number].name, "cells": cells, "thickness": thickness}
            for cells, thickness, number in sorted((*cells_through(mesh, i), i) for i in range(len(scene.bodies)))
        ],
        "poor_cells": int((quality < POOR_QUALITY).sum()),
        "smallest_gap": None,
        "near_pairs": 0,
        "defects": [],
        "edges_per_step": None,
    }
    defects: list[Defect] = []
    names = [body.name for body in scene.bodies]
    try:
        defects = list(level_defects(scene, meshes, level, obstacles, diagonal))
        entry["defects"] = [str(d.error) for d in defects]
        begun = started(scene, mesh, level)
        speed = float(np.linalg.norm(initial_velocity(scene, mesh, begun.points), axis=1).max())
        entry["speed"], entry["edges_per_step"] = speed, speed * scene.dt / entry["shortest_edge"]
        if scene.contact and not defects:
            dhat = metres(next(c.dhat for c in scene.contact if isinstance(c, Barrier)), diagonal)
            gap, _ = smallest_gap(begun, obstacles, names, GAP_RANGE * dhat)
            if gap is not None:
                entry["smallest_gap"] = {**gap, "dhats": gap["distance"] / dhat}
                entry["near_pairs"] = smallest_gap(begun, obstacles, names, dhat)[1]
    except InputError as error:
        entry["defects"] = entry["defects"] or [str(error)]
    return entry, defects


def level_sizes(mesh: LevelMesh, level: int) -> dict[str, Any]:
    """The level's number and how large its mesh and parts of it are [m]."""
    corners, pairs = mesh.points[mesh.cells], combinations(range(mesh.dim + 1), 2)
    return {
        "level": level,
        "vertices": len(mesh.points),
        "cells": len(mesh.cells),
        "surface_vertices": len(np.unique(mesh.boundary)),
        "volume": float(mesh.volumes.sum()),
        "smallest_cell": float(mesh.volumes.min()),
        "shortest_edge": float(min(np.linalg.norm(corners[:, i] - corners[:, j], axis=1).min() for i, j in pairs)),
    }


def sizes_line(sizes: dict[str, Any]) -> str:
    """What `level_sizes` gives, in one line."""
    return (
        f"level {sizes['level']}: {sizes['vertices']:,} vertices, {sizes['cells']:,} cells,"
        f" {sizes['surface_vertices']:,} on the surface, volume {sizes['volume']:.4g}, smallest cell"
        f" {sizes['smallest_cell']:.2g}, shortest edge {sizes['shortest_edge']:.3g} m"
    )


def _write_levels(out: Path, scene: Scene, meshes: Sequence[LevelMesh], found: Sequence[Sequence[Defect]]) -> None:
    with writable(out):
        for level, (mesh, defects) in enumerate(zip(meshes, found, strict=True)):
            corners = [(corner, number) for number, defect in enumerate(defects, 1) for corner in defect.primitives]
            marks, begun = np.zeros(len(mesh.points), dtype=np.int32), mesh
            with suppress(InputError):  # it is among the defects
                begun = started(scene, mesh, level)
            if corners:
                places = {tuple(point): i for i, point in enumerate(begun.points)}
                for corner, number in corners:
                    marks[[places[tuple(point)] for point in corner if tuple(point) in places]] = number
                write_primitives(out / f"defects_{level}.vtu", *zip(*corners, strict=True))
            write_vtu(
                out / f"level_{level}.vtu", begun, {"defect": marks}, {"quality": mean_ratio(mesh.points, mesh.cells)}
            )


def _estimate_costs(
    result: dict, scene: Scene, meshes: Sequence[LevelMesh], obstacles: Sequence, diagonal: float, seconds: float
) -> None:
    """Add the estimated cost of each level, from the beginning of level 0."""
    mesh, dim = meshes[0], meshes[0].dim
    hierarchy = Hierarchy([mesh], MPI.COMM_SELF)
    model = level_model(scene, hierarchy, 0, diagonal, obstacles)
    begin, spent, iterations = time.perf_counter(), [], []

    def bound(state: dict) -> None:
        if state["seconds"]["total"] > LONGEST_STEP:
            raise TimeoutError(f"step {state['step']} of level 0 takes more than {LONGEST_STEP:g} s")

    stepper = Stepper(model, hierarchy[0], show=bound)
    try:
        for report in direct(stepper, Start.at_rest(model.start, model.velocity), scene.steps):
            spent.append(report.seconds["total"])
            say(f"{len(spent)} steps")
            iterations.append(report.newton_iterations)
            if time.perf_counter() - begin > seconds:
                break
    except SimulationError as error:
        result["defects"].append(f"defect: {error}")
    except TimeoutError as error:
        result["notes"].append(f"{error}; check the signs of the law's terms, or take a smaller dt")
    if not spent:
        return
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    step = float(np.mean(spent))
    newton = float(np.mean(iterations))
    result["measured"] = {"steps": len(spent), "seconds_per_step": step, "newton_iterations": newton}
    smoothed = any(scene.elements_of(body) == "smoothed" for body in scene.bodies)
    memory = MEMORY_PER_VERTEX[dim] * (SMOOTHED_MEMORY if smoothed else 1.0)
    extra = COST_OFFSET[dim] * (SMOOTHED_OFFSET if smoothed else 1.0)
    for entry in result["levels"]:
        n, n0 = entry["vertices"], len(mesh.points)
        entry["seconds_per_step"] = step * ((n + extra) / (n0 + extra)) ** COST_EXPONENT
        entry["seconds"] = scene.steps * entry["seconds_per_step"]
        entry["memory_mb"] = used + memory * (n - n0) / 1024


def _result_notes(result: dict) -> Iterator[str]:
    """Lines on what the numbers of `check_scene` mean for a run."""
    for entry in result["levels"]:
        level = f"level {entry['level']}"
        if entry["edges_per_step"] is not None and entry["edges_per_step"] > 1.0:
            fits = f"contact holds, detail may not (dt = {entry['shortest_edge'] / entry['speed']:.2g} s crosses one)"
            many = f"{entry['edges_per_step']:.1f} of its shortest edges per step"
            yield f"{level}: at {entry['speed']:.3g} m/s a body crosses {many}; {fits}"
        if thin := [part["body"] for part in entry["thinnest"] if part["cells"] == 1]:
            yield (
                f"{level}: one cell lies through the thinnest part of {named(thin)}, which bends too little (a slab"
                " of 60 vertices 0.73 times, a chain of rings of 93 each 0.34 times as far); ask for more vertices"
            )
        if entry["poor_cells"]:
            slow = "they slow the linear solver"
            yield f"{level}: {entry['poor_cells']} cells have a mean ratio below {POOR_QUALITY:g}; {slow}"
        if entry["near_pairs"]:
            yield f"{level}: {entry['near_pairs']} pairs of primitives are nearer than dhat at t = 0 and push at once"
    if result["stiffness_ratio"] is not None and result["stiffness_ratio"] > HIGH_STIFFNESS_RATIO:
        yield (
            f"stiffness ratio {result['stiffness_ratio']:.1g}; the direct linear solver is the safer choice (--set"
            " linear=direct)"
        )
