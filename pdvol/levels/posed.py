"""Starts that are given on a mesh, on the vertices of any level of the same body."""

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.locate import nearest_material
from pdvol.scene import Posed


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
