"""Where the points of a level are at t = 0: at rest, or where a body's `start` leads its rest positions.

A level's mesh stays the shape without stress: energies, masses, areas of contact, materials, bindings and interpolants
are those of the mesh. What is checked at t = 0, and what holds from t = 0 on, is evaluated at the start.
"""

from dataclasses import replace

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import LevelMesh, principal_stretches, simplex_volumes
from pdvol.scene import Posed, Scene
from pdvol.scene.checks import numbers, require


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
        rest = mesh.points[mine]
        if isinstance(body.start, Posed):
            positions[mine] = posed_positions(body.start, rest, name)
        else:
            positions[mine] = numbers(name, body.start, (rest.copy(),), rest.shape)
        size, far = float(np.linalg.norm(np.ptp(rest, axis=0))), float(np.abs(positions[mine]).max())
        require(
            far <= FARTHEST_BODY * size,
            f"{name} leads a vertex {far:.3g} m away, where coordinates of a body of {size:.3g} m lose their precision",
        )
        cells = np.flatnonzero(mesh.bodies == number)
        ratios = simplex_volumes(positions, mesh.cells[cells]) / mesh.volumes[cells]
        if ratios.min() <= 0.0:
            worst, bad = cells[int(ratios.argmin())], int((ratios <= 0.0).sum())
            place = ", ".join(f"{x:.4g}" for x in mesh.points[mesh.cells[worst]].mean(axis=0))
            raise InputError(
                f"{name} turns {bad:,} of {len(cells):,} cells inside out or flat, as cell {worst} at"
                f" ({place}), which gets {ratios.min():.3g} times its volume; give a start that bends"
                " and stretches less within a cell, or more vertices"
            )
    return positions


def posed_positions(posed: Posed, points: np.ndarray, whose: str) -> np.ndarray:
    """(n, d) [m]: where rest positions (n, d) of a level are at t = 0, by the linear map of the cell that each lies in,
    or that is nearest to it. Vertices of the posed mesh itself are where it says, to the last bit.

    Raises
    ------
    InputError
        The mesh has another dimension, or a flat cell, or is too far from a point; `whose` names the start.
    """
    rest, cells, positions = np.asarray(posed.rest), np.asarray(posed.cells), np.asarray(posed.positions)
    if rest.shape[1] != points.shape[1]:
        raise InputError(f"{whose} is {rest.shape[1]}D in a {points.shape[1]}D scene")
    used, cells = np.unique(cells, return_inverse=True)
    rest, positions, cells = rest[used], positions[used], cells.reshape(-1, points.shape[1] + 1)
    if np.array_equal(rest, points):
        return positions.astype(float)
    none = np.zeros(len(cells), dtype=np.int32)
    mesh = LevelMesh(rest, cells, none, none)
    if not np.abs(mesh.volumes).min() > 0.0:
        raise InputError(f"{whose} has a flat cell at rest, {int(np.abs(mesh.volumes).argmin())}; leave it out")
    from pdvol.levels.locate import nearest_material  # loads search trees and finite elements

    found, weights = nearest_material(mesh, points, np.zeros(len(points), dtype=np.int64))
    corners = cells[found]
    distances = np.linalg.norm(points - np.einsum("nc,nci->ni", weights, rest[corners]), axis=1)
    limit = posed.tolerance * np.linalg.norm(np.ptp(rest, axis=0))
    far = int((distances > limit).sum())
    if far:
        place = ", ".join(f"{x:.4g}" for x in points[int(distances.argmax())])
        raise InputError(
            f"{whose}: {far:,} of {len(points):,} vertices are further than {limit:.3g} m from its mesh at rest, as the"
            f" one at ({place}), {distances.max():.3g} m; give that mesh as placed, or raise Posed.tolerance"
        )
    return np.einsum("nc,nci->ni", mesh.coordinates(found, points), positions[corners])


def started(scene: Scene, mesh: LevelMesh, level: int) -> LevelMesh:
    """A level with its points where they are at t = 0, for what is checked there: sizes of its cells and facets are not
    those at rest. Itself where no body has a `start`; raises as `start_positions`.
    """
    positions = start_positions(scene, mesh, level)
    return mesh if positions is mesh.points else replace(mesh, points=positions)


def start_notes(scene: Scene, mesh: LevelMesh, level: int) -> list[str]:
    """A line for each body that has a `start`: how it is stretched at t = 0. Raises as `start_positions`."""
    positions, notes = start_positions(scene, mesh, level), []
    for number, body in enumerate(scene.bodies):
        if body.start is not None:
            stretches = principal_stretches(mesh, positions)[mesh.bodies == number]
            notes.append(
                f"level {level}: body {body.name!r} starts away from rest, its cells stretched by"
                f" {stretches.min():.3g} to {stretches.max():.3g}"
            )
    return notes
