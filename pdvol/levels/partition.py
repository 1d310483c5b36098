"""Which rank gets which cells, where the mesh alone does not say it well: several bodies, that will touch.

A graph partitioner sees no contact: it gives each rank bodies of its own, and no rank's part of a preconditioner then
knows how they press on each other. Here every body is shared out among all ranks, by planes across one axis for all of
them.
"""

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh


def shared_bodies(mesh: LevelMesh, ranks: int) -> np.ndarray:
    """Rank (m,) int32 of each cell, by recursive bisection of all bodies at their medians."""
    owner = np.zeros(len(mesh.cells), dtype=np.int32)
    _bisect(mesh.points[mesh.cells], mesh.bodies, np.arange(len(mesh.cells)), 0, ranks, owner)
    return owner


def _bisect(
    corners: np.ndarray, bodies: np.ndarray, cells: np.ndarray, first: int, ranks: int, owner: np.ndarray
) -> None:
    owner[cells] = first
    if ranks == 1 or not len(cells):
        return
    lower = ranks // 2
    below = min(
        (_halves(corners, bodies, cells, axis, lower / ranks) for axis in range(corners.shape[2])),
        key=lambda half: half[0],
    )[1]
    _bisect(corners, bodies, cells[below], first, lower, owner)
    _bisect(corners, bodies, cells[~below], first + lower, ranks - lower, owner)


def _halves(
    corners: np.ndarray, bodies: np.ndarray, cells: np.ndarray, axis: int, share: float
) -> tuple[float, np.ndarray]:
    """Each body's cells below the plane that leaves `share` of them there, and what such a cut costs: cells that it
    goes through, times how far the bodies lie apart along the axis: across what lies between them they would press on
    another rank's.
    """
    low, high, middle = (function(corners[cells, :, axis], axis=1) for function in (np.min, np.max, np.mean))
    below, cut, centres, sizes = np.zeros(len(cells), dtype=bool), 0, [], []
    for body in np.unique(bodies[cells]):
        own = np.flatnonzero(bodies[cells] == body)
        order = np.argsort(middle[own], kind="stable")
        count = round(share * len(own))
        place = middle[own[order[min(count, len(own) - 1)]]]
        below[own[order[:count]]] = True
        cut += np.count_nonzero((low[own] < place) & (high[own] > place))
        centres.append(place)
        sizes.append(np.ptp(middle[own]))
    return cut * (1.0 + np.ptp(centres) / max(np.mean(sizes), 1e-300)), below
