"""Where the points of a level are at t = 0: at rest, or where a body's `start` leads its rest positions.

A level's mesh stays the shape without stress: energies, masses, areas of contact, materials, bindings and interpolants
are those of the mesh. What is checked at t = 0, and what holds from t = 0 on, is asked at the start.
"""

from collections.abc import Callable

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import LevelMesh, simplex_volumes
from pdvol.scene import Posed, Scene
from pdvol.scene.checks import called, require


def start_positions(scene: Scene, mesh: LevelMesh, level: int) -> np.ndarray:
    """(n, d) [m]: a level's points at t = 0; the mesh's own array where no body has a `start`.

    Raises
    ------
    InputError
        A body's `start` fails, gives an array of another shape, NaN, infinity or places too far away, or turns cells
        inside out or flat.
    """
    if all(body.start is None for body in scene.bodies):
        return mesh.points
    from pdvol.meshing.verdict import FARTHEST_BODY  # loads libigl, which describing a scene does not need

    positions = mesh.points.copy()
    for number, body in enumerate(scene.bodies):
        if body.start is None:
            continue
        mine = mesh.point_bodies == number
        name = f"level {level}: the start of body {body.name!r}"
        positions[mine] = _begun(body.start, mesh.points[mine], name)
        size, far = float(np.linalg.norm(np.ptp(mesh.points[mine], axis=0))), float(np.abs(positions[mine]).max())
        require(
            far <= FARTHEST_BODY * size,
            f"{name} leads a vertex {far:.3g} m away, where coordinates of a body of {size:.3g} m lose their precision",
        )
        cells = np.flatnonzero(mesh.bodies == number)
        shares = simplex_volumes(positions, mesh.cells[cells]) / mesh.volumes[cells]
        if shares.min() <= 0.0:
            worst, bad = cells[int(shares.argmin())], int((shares <= 0.0).sum())
            raise InputError(
                f"{name} turns {bad:,} of {len(cells):,} cells inside out or flat, as cell {worst} at"
                f" {_place(mesh, worst)}, which gets {shares.min():.3g} times its volume; give a start that bends and"
                " stretches less within a cell, or more vertices"
            )
    return positions


def _begun(start: Posed | Callable[[np.ndarray], np.ndarray], points: np.ndarray, name: str) -> np.ndarray:
    """Where rest positions (n, d) of a body are at t = 0; `name` begins the messages of InputError."""
    if isinstance(start, Posed):
        from pdvol.levels.posed import posed_positions  # loads search trees and finite elements

        return posed_positions(start, points, name)
    found = called(name, start, (points.copy(),), points.shape)
    require(np.issubdtype(found.dtype, np.number), f"{name} gives no numbers, but {found.dtype}")
    require(bool(np.isfinite(found).all()), f"{name} gives NaN or infinity")
    return found.astype(float)


def _place(mesh: LevelMesh, cell: int) -> str:
    """The centre of a cell at rest, in words."""
    return f"({', '.join(f'{x:.4g}' for x in mesh.points[mesh.cells[cell]].mean(axis=0))})"


def started(scene: Scene, mesh: LevelMesh, level: int) -> LevelMesh:
    """A level with its points where they are at t = 0, for what is checked there: sizes of its cells and facets are not
    those at rest. Itself where no body has a `start`; raises as `start_positions`.
    """
    positions = start_positions(scene, mesh, level)
    return mesh if positions is mesh.points else LevelMesh(positions, mesh.cells, mesh.bodies, mesh.regions)


def start_notes(scene: Scene, mesh: LevelMesh, level: int) -> list[str]:
    """A line for each body that has a `start`: how it is stretched at t = 0. Raises as `start_positions`."""
    positions, notes = start_positions(scene, mesh, level), []
    for number, body in enumerate(scene.bodies):
        if body.start is not None:
            mine = mesh.bodies == number
            gradients = np.einsum("mci,mcj->mij", positions[mesh.cells[mine]], mesh.hat_gradients[mine])
            stretches = np.linalg.svd(gradients, compute_uv=False)
            notes.append(
                f"level {level}: body {body.name!r} starts away from rest, its cells stretched by"
                f" {stretches.min():.3g} to {stretches.max():.3g}"
            )
    return notes
