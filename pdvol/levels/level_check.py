"""What would stop a scene on one level, found before it runs: the same for `pdvol check`, `hierarchy` and `run`."""

from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np
import scipy.sparse as sp

from pdvol.errors import InputError
from pdvol.geometry.boundary_search import BoundarySearch
from pdvol.geometry.flat_faces import unit_normals
from pdvol.geometry.level_mesh import LevelMesh, facet_sizes
from pdvol.levels.geodesic import vertex_adjacency
from pdvol.levels.initial_state import Defect, find_defects
from pdvol.levels.materials import cell_materials
from pdvol.levels.scene_fields import check_fields
from pdvol.levels.script import Obstacle
from pdvol.levels.start import start_notes, started
from pdvol.scene import Barrier, Gravity, Scene, metres
from pdvol.scene.loads import at_time

MOST_TURN = np.pi
"""Turn [rad] in a step from which on it cannot be seen which way a body turns."""
COARSE_TURN = 0.5
"""Turn [rad] in a step from which on time stepping stretches a body visibly: by (1 + turn^2)^(1/2)."""
DAMPING_POWERS = {"implicit_euler": 2, "bdf2": 4}
"""Powers p of the turn [rad] in a step: a rigid body that turns freely keeps (1 + 2 n turn^p)^(-1/p) of its spin over
n steps (docs/benchmarks.md, a spin)."""
LOST_SPIN = 0.1
"""Share of a spin: more of it lost to time stepping alone within a shot shows."""
FACING = -0.7  # cosine between the normals of two facets below which they are the two sides of a part
THINNEST_SHARE = 0.01  # of the area of a body's facets with another side: the thinnest ones set its thickness
AS_THIN = 1.5  # ratio of thicknesses up to which facets belong to the thinnest part
LOOKED_AT = 200  # facets of it whose cells are counted: more take longer and change no median
MOST_CELLS = 10  # cells that are counted
INSET = 1e-6  # of a body's size: rays begin so far inside


def level_defects(
    scene: Scene, level_meshes: Sequence[LevelMesh], level: int, obstacles: Sequence[Obstacle], diagonal: float
) -> Iterator[Defect]:
    """Everything on a level that stops a run; the first one where others would follow from it.

    Parameters
    ----------
    level_meshes : all levels, coarsest first
    level : the one that is looked at
    diagonal : of the smallest free body [m] (`scene_diagonal`)
    """
    mesh = level_meshes[level]
    try:
        check_fields(scene, mesh, level)
        for body in scene.bodies:
            turn = _turn(scene, body.spin)
            if turn >= MOST_TURN:
                raise InputError(
                    f"body {body.name!r}: its spin turns it by {turn:.3g} rad in a step of {scene.dt:g} s, which a step"
                    f" cannot resolve; slow it down, or take dt below {scene.dt * COARSE_TURN / turn:.2g} s"
                )
        for barrier in scene.contact:
            if isinstance(barrier, Barrier):
                check_distance([body.name for body in scene.bodies], mesh, metres(barrier.dhat, diagonal))
    except InputError as error:
        yield Defect(error, [])
        return
    if scene.contact:  # without contact bodies may cross
        begun = [started(scene, other, number) for number, other in enumerate(level_meshes)]
        yield from find_defects(level, begun[level], obstacles, [body.name for body in scene.bodies], begun)


def weight_notes(scene: Scene, mesh: LevelMesh) -> Iterator[str]:
    """A line for each body whose Young's modulus is below the pressure of its weight, at t = 0."""
    loads = (load.acceleration for load in scene.loads if isinstance(load, Gravity))
    pull = sum((at_time("gravity", load, 0.0, mesh.dim) for load in loads), np.zeros(mesh.dim))
    materials, heights = cell_materials(scene, mesh), mesh.points @ pull
    for number, body in enumerate(scene.bodies):
        cells = mesh.bodies == number
        young = materials.young[cells].max()
        pressure = materials.density[cells].min() * np.ptp(heights[mesh.point_bodies == number])
        if young < pressure:
            weight = f"its weight, density * g * height = {pressure:.2g} Pa"
            yield f"body {body.name!r}: young = {young:.2g} Pa cannot carry {weight}; moduli are in Pa (1 MPa is 1e6)"


def level_notes(scene: Scene, mesh: LevelMesh, level: int, diagonal: float) -> list[str]:
    """What does not stop a run on a level without `level_defects`, but spoils it: lines."""
    notes = []
    with suppress(InputError):  # what stops a run is found by `level_defects`
        notes += start_notes(scene, mesh, level)
    for number, body in enumerate(scene.bodies):
        turn = _turn(scene, body.spin)
        lost = 1.0 - spin_kept(scene.integrator, turn, scene.steps)
        if level == 0 and lost > LOST_SPIN and turn < MOST_TURN:
            notes.append(
                f"body {body.name!r}: its spin turns it by {turn:.2g} rad a step; time stepping damps that, and takes"
                f" {100 * lost:.2g} % of it within {scene.dt * scene.steps:.3g} s unless contact does before"
                f" ({_slower_damping(scene, turn)})"
            )
        for barrier in scene.contact:
            if isinstance(barrier, Barrier):
                dhat, thin = metres(barrier.dhat, diagonal), _sides(mesh, number).min()
                if thin <= dhat < _sides(mesh, number).max():
                    notes.append(
                        f"level {level}: dhat = {dhat:.3g} m is no less than the thickness of body {body.name!r}"
                        f" ({thin:.3g} m); its own sides may push each other"
                    )
    return notes


def spin_kept(integrator: str, turn: float, steps: int) -> float:
    """The fraction of its spin that a rigid body keeps, which turns freely by `turn` [rad] in its first step. An
    integrator that is not in `DAMPING_POWERS` is taken to keep all.
    """
    power = DAMPING_POWERS.get(integrator)
    return 1.0 if power is None else float((1.0 + 2.0 * steps * turn**power) ** (-1.0 / power))


def _slower_damping(scene: Scene, turn: float) -> str:
    """How less of a spin would be lost, in words."""
    power = DAMPING_POWERS[scene.integrator]
    # n = T / dt steps of turn = spin dt lose as much as LOST_SPIN where 2 (T / dt) (spin dt)^p is this:
    allowed = (1.0 - LOST_SPIN) ** -power - 1.0
    dt = scene.dt * (allowed / (2.0 * scene.steps * turn**power)) ** (1.0 / (power - 1))
    words = f"dt = {dt:.2g} s takes {100 * LOST_SPIN:g} %"
    other = 1.0 - spin_kept("bdf2", turn, scene.steps)
    return words if scene.integrator == "bdf2" else f"{words}; integrator=bdf2 {100 * other:.2g} %"


def cells_through(mesh: LevelMesh, number: int) -> tuple[int, float]:
    """Cells through the thinnest part of a body, its median and `MOST_CELLS` at most, and its thickness [m]. They are
    the fewest edges from a boundary facet to the one behind.
    """
    mesh = mesh.body(number)[0]
    facets = mesh.boundary
    normals = unit_normals(mesh.points, facets)
    size, centres = float(np.linalg.norm(np.ptp(mesh.points, axis=0))), mesh.points[facets].mean(axis=1)
    behind, away = BoundarySearch(mesh, number).first_hits(centres - INSET * size * normals, centres - size * normals)
    away += INSET * size
    facing = (behind >= 0) & ((normals * normals[behind]).sum(axis=1) < FACING)
    facing &= ~(facets[:, :, None] == facets[behind][:, None]).any(axis=(1, 2))
    if not facing.any():
        return 1, float(away.min())
    order = np.flatnonzero(facing)[np.argsort(away[facing], kind="stable")]
    areas = np.cumsum(facet_sizes(mesh.points, facets[order]))
    thickness = float(away[order[np.searchsorted(areas, THINNEST_SHARE * areas[-1])]])
    part = order[away[order] <= AS_THIN * thickness]
    part = part[:: -(-len(part) // LOOKED_AT)]
    row, shape = np.repeat(np.arange(len(part)), mesh.dim), (len(part), len(mesh.points))
    reached, wanted = (
        sp.csr_array((np.ones(len(row)), (row, facets[which].ravel())), shape=shape) for which in (part, behind[part])
    )
    adjacency = vertex_adjacency(mesh).astype(float)
    for count in range(1, MOST_CELLS):
        reached = (reached + reached @ adjacency).sign()
        if (reached * wanted).sum(axis=1).astype(bool).mean() >= 0.5:
            return count, thickness
    return MOST_CELLS, thickness


def check_distance(bodies: Sequence[str], mesh: LevelMesh, dhat: float) -> None:
    """InputError where the contact distance dhat [m] is larger than one of the bodies, which are given by names."""
    for number, body in enumerate(bodies):
        long = _sides(mesh, number).max()
        if dhat >= long:
            raise InputError(
                f"body {body!r}: the contact distance dhat = {dhat:.3g} m is larger than the body ({long:.3g} m);"
                f" give Barrier(dhat=...) of {1e-3 * long:.1g} m or so"
            )


def _sides(mesh: LevelMesh, body: int) -> np.ndarray:
    """The sides [m] of the box around a body."""
    return np.ptp(mesh.points[mesh.point_bodies == body], axis=0)


def _turn(scene: Scene, spin: object) -> float:
    """The angle [rad] by which a spin turns a body in a step."""
    return float(np.linalg.norm(np.ravel(np.asarray(spin, dtype=float)))) * scene.dt
