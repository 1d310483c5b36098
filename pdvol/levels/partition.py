"""A partition of the cells of bodies that may touch.

A graph partitioner does not know contacts. It gives each rank bodies from anywhere, and the local preconditioners then
contain no contact. Here few bodies are each divided among all ranks, by planes across a common axis. Of many bodies
each rank gets those of a region: contacts within it are in its preconditioner, and so are all of their cells. One body
is cut in the same way: dolfinx's partitioner divides it differently in each run, so that none would repeat.
"""

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh

# bodies a rank from which on none is cut. Two ranks take 81 iterations of conjugate gradients a step for two cubes that
# are cut, and 122 with a cube each; for 27 balls 377, and 294 with whole balls (one rank: 61 and 229).
WHOLE_BODIES = 4
# fraction of a region's cells by which whole bodies may miss the fraction that is wanted
IMBALANCE = 0.05


def shared_cells(mesh: LevelMesh, ranks: int) -> np.ndarray:
    """Rank (m,) int32 of each cell, by recursive bisection: between bodies, or through all of them at their medians."""
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
    below = _whole_bodies(corners[cells], bodies[cells], lower / ranks, WHOLE_BODIES * ranks)
    if below is None:
        below = min(
            (_halves(corners, bodies, cells, axis, lower / ranks) for axis in range(corners.shape[2])),
            key=lambda half: half[0],
        )[1]
    _bisect(corners, bodies, cells[below], first, lower, owner)
    _bisect(corners, bodies, cells[~below], first + lower, ranks - lower, owner)


def _whole_bodies(corners: np.ndarray, bodies: np.ndarray, fraction: float, least: int) -> np.ndarray | None:
    """The cells (k,) of the bodies at one end of a region, about `fraction` of all, along the axis on which the bodies'
    centres are spread most. None where there are less bodies than `least`, or none of their sums is near that fraction.
    """
    body = np.unique(bodies, return_inverse=True)[1]
    counts = np.bincount(body)
    if len(counts) < least:
        return None
    middles = corners.mean(axis=1)
    centres = np.stack([np.bincount(body, middle) / counts for middle in middles.T], axis=1)
    order = np.argsort(centres[:, np.ptp(centres, axis=0).argmax()], kind="stable")
    fractions = np.cumsum(counts[order]) / len(bodies)
    last = int(np.abs(fractions - fraction).argmin())
    return np.isin(body, order[: last + 1]) if abs(fractions[last] - fraction) <= IMBALANCE else None


def _halves(
    corners: np.ndarray, bodies: np.ndarray, cells: np.ndarray, axis: int, fraction: float
) -> tuple[float, np.ndarray]:
    """The cost of a cut across an axis, and the cells (k,) below it. Each body is cut by a plane of its own with
    `fraction` of its cells below. The cost is the number of cells that are cut, times a factor that grows with the
    distance of the bodies' planes: contacts between those planes join two ranks.
    """
    low, high, middle = (function(corners[cells, :, axis], axis=1) for function in (np.min, np.max, np.mean))
    below, cut, centres, sizes = np.zeros(len(cells), dtype=bool), 0, [], []
    for body in np.unique(bodies[cells]):
        own = np.flatnonzero(bodies[cells] == body)
        order = np.argsort(middle[own], kind="stable")
        count = round(fraction * len(own))
        place = middle[own[order[min(count, len(own) - 1)]]]
        below[own[order[:count]]] = True
        cut += np.count_nonzero((low[own] < place) & (high[own] > place))
        centres.append(place)
        sizes.append(np.ptp(middle[own]))
    return cut * (1.0 + np.ptp(centres) / max(np.mean(sizes), 1e-300)), below
