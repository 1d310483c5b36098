"""A partition of the cells of several bodies that may touch.

A graph partitioner does not know contacts. It gives each rank bodies of its own, and the local preconditioners then
contain no contact. Here every body is divided among all ranks, by planes across a common axis.
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
    """The cost of a cut across an axis, and the cells (k,) below it. Each body is cut by a plane of its own with
    `share` of its cells below. The cost is the number of cells that are cut, times a factor that grows with the
    distance of the bodies' planes: contacts between those planes join two ranks.
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
