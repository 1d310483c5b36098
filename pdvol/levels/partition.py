"""A partition of the cells of bodies that may touch.

A graph partitioner does not know contacts. It gives each rank bodies from anywhere, and the local preconditioners then
contain no contact. Here ranks get regions of space: contacts are between neighbours in space, so that few join two
ranks. Where bodies move far, their positions in the coarser level's step with most contacts say what is near. Of few
bodies each is cut by the region's planes; of many bodies each is on one rank. dolfinx's partitioner divides a mesh
differently in each run, so that none would repeat.
"""

import numpy as np
from scipy.spatial import cKDTree

from pdvol.geometry.level_mesh import LevelMesh

# bodies a rank from which on none is cut: all cells of a body are in one rank's preconditioner then
WHOLE_BODIES = 4
# fraction of a region's cells by which whole bodies may miss the fraction that is wanted
IMBALANCE = 0.05
# distance of near vertices of two bodies, over the median edge of the surface: those that contact couples are nearer
NEAR = 1.0
# cells that take as much time as a pair of near vertices: jelly_bowl spends a third of its time on contact
CELLS_A_PAIR = 4


def shared_cells(mesh: LevelMesh, ranks: int, places: np.ndarray | None = None) -> np.ndarray:
    """Rank (m,) int32 of each cell, by recursive bisection: between bodies, or by a plane through all of them.

    Parameters
    ----------
    places : (n, d) [m]
        The vertices' positions by which space is divided; those at rest without it.
    """
    owner = np.zeros(len(mesh.cells), dtype=np.int32)
    if ranks > 1:
        places = mesh.points if places is None else places
        one_of = np.empty(len(places), dtype=np.int64)  # each vertex's cells
        one_of[mesh.cells] = np.arange(len(mesh.cells))[:, None]
        division = _Division(places[mesh.cells], mesh.bodies, one_of[_near_pairs(mesh, places)])
        division.divide(np.arange(len(mesh.cells)), 0, ranks, owner)
    return owner


def carried(coarse: LevelMesh, places: np.ndarray, fine: LevelMesh) -> np.ndarray:
    """(n, d) [m]: where a level's vertices are about, if those of a coarser one are at `places`. Each goes with the
    cell of its body whose centre is nearest to it at rest.
    """
    found = np.empty_like(fine.points)
    for body in np.unique(fine.point_bodies):
        mine, cells = np.flatnonzero(fine.point_bodies == body), coarse.cells[coarse.bodies == body]
        nearest = cells[cKDTree(coarse.points[cells].mean(axis=1)).query(fine.points[mine])[1]]
        rest, moved = (points[nearest] for points in (coarse.points, places))
        shares = np.linalg.solve(
            np.swapaxes(rest[:, 1:] - rest[:, :1], 1, 2), (fine.points[mine] - rest[:, 0])[..., None]
        )
        found[mine] = moved[:, 0] + (np.swapaxes(moved[:, 1:] - moved[:, :1], 1, 2) @ shares)[..., 0]
    return found


def _near_pairs(mesh: LevelMesh, places: np.ndarray) -> np.ndarray:
    """(k, 2): vertices of the surfaces of different bodies that are near each other."""
    if (mesh.bodies == mesh.bodies[0]).all():
        return np.empty((0, 2), dtype=np.int64)
    surface, edges = np.unique(mesh.boundary), places[mesh.boundary[:, 0]] - places[mesh.boundary[:, 1]]
    reach = NEAR * float(np.median(np.linalg.norm(edges, axis=1)))
    pairs = surface[cKDTree(places[surface]).query_pairs(reach, output_type="ndarray")]
    return pairs[np.diff(mesh.point_bodies[pairs], axis=1)[:, 0] != 0]


class _Division:
    """Cells at `corners` (m, d + 1, d) of `bodies` (m,), and near vertices as pairs (k, 2) of cells that have them."""

    def __init__(self, corners: np.ndarray, bodies: np.ndarray, pairs: np.ndarray):
        self.bodies, self.pairs = bodies, pairs
        self.low, self.middle, self.high = (function(corners, axis=1) for function in (np.min, np.mean, np.max))

    def divide(self, cells: np.ndarray, first: int, ranks: int, owner: np.ndarray) -> None:
        """Shares the `cells` (k,) out among so many ranks from `first` on."""
        owner[cells] = first
        if ranks == 1 or not len(cells):
            return
        lower = ranks // 2
        below = self._whole_bodies(cells, lower / ranks, WHOLE_BODIES * ranks)
        if below is None:
            halves = [self._half(cells, axis, lower / ranks) for axis in range(self.middle.shape[1])]
            below = min(halves, key=lambda half: self._lost(cells, *half))[1]
        self.divide(cells[below], first, lower, owner)
        self.divide(cells[~below], first + lower, ranks - lower, owner)

    def _whole_bodies(self, cells: np.ndarray, fraction: float, least: int) -> np.ndarray | None:
        """Mask (k,) of the cells of the bodies at one end of a region, about `fraction` of all, along the axis on which
        the bodies' centres are spread most. None where there are less bodies than `least`, or none of their sums is
        near that fraction.
        """
        body = np.unique(self.bodies[cells], return_inverse=True)[1]
        counts = np.bincount(body)
        if len(counts) < least:
            return None
        centres = np.stack([np.bincount(body, middle) / counts for middle in self.middle[cells].T], axis=1)
        order = np.argsort(centres[:, np.ptp(centres, axis=0).argmax()], kind="stable")
        fractions = np.cumsum(counts[order]) / len(cells)
        last = int(np.abs(fractions - fraction).argmin())
        return np.isin(body, order[: last + 1]) if abs(fractions[last] - fraction) <= IMBALANCE else None

    def _half(self, cells: np.ndarray, axis: int, fraction: float) -> tuple[int, np.ndarray]:
        """The axis, and the mask (k,) of the cells below the plane across it that has `fraction` of them below."""
        below = np.zeros(len(cells), dtype=bool)
        below[np.argsort(self.middle[cells, axis], kind="stable")[: round(fraction * len(cells))]] = True
        return axis, below

    def _lost(self, cells: np.ndarray, axis: int, below: np.ndarray) -> float:
        """What both sides of a cut have to compute: cells that the plane cuts, and near pairs of both sides."""
        side = np.zeros(len(self.bodies), dtype=np.int8)
        side[cells] = np.where(below, 1, 2)
        apart = np.count_nonzero(side[self.pairs].prod(axis=1) == 2)
        place = self.middle[cells, axis]
        place = 0.5 * (place[below].max(initial=place.min()) + place[~below].min(initial=place.max()))
        cut = np.count_nonzero((self.low[cells, axis] < place) & (self.high[cells, axis] > place))
        return cut + CELLS_A_PAIR * apart
