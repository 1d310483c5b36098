r"""Pressure on closed surfaces: E = -p V, V the volume that they enclose, exactly that of their straight facets.

The force on a facet is p times its vector area, shared out to its corners; all forces of a closed surface sum to zero.
V is linear in each vertex, so its Hessian has blocks between the two ends a, b of an edge only. In 3D such a block is
[w]_x / 6, w = l - c, c and l being the vertices opposite to the edge in the triangles that hold it as a -> b and as b
-> a. In 2D it is half a quarter turn. The matrix of an edge, blocks S above and S' below the diagonal, has the
eigenvalues +-|w| / 6 (+-1/2 in 2D) and, in 3D, twice zero: its absolute value is |w| / 6 (1 - w w' / |w|^2) on the
diagonal, from which both projections follow.
"""

from collections.abc import Callable

import numpy as np

from pdvol.geometry.closed_surfaces import enclosed_volume, volume_gradient
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions, Term


class EnclosedPressure(Term):
    """One pressure. Every rank evaluates all facets.

    Parameters
    ----------
    space : LevelSpace
    facets : (k, d) int64, closed, with what is under pressure behind them
    pressure : time [s] -> [Pa]
    """

    name = "pressure"

    def __init__(self, space: LevelSpace, facets: np.ndarray, pressure: Callable[[float], float]):
        self.space, self.facets, self._at = space, facets, pressure
        self.pressure = 0.0
        n, d = len(space.mesh.points), space.dim
        turned = [np.roll(facets, -turn, axis=1) for turn in range(d if d == 3 else 1)]
        halves = np.concatenate(turned)
        low, high = halves[:, :2].min(axis=1), halves[:, :2].max(axis=1)
        keys, self._edge = np.unique(low * n + high, return_inverse=True)
        self._low, self._high = keys // n, keys % n
        self._opposite = halves[:, 2] if d == 3 else None
        self._sign = np.where(halves[:, 0] == low, 1.0, -1.0)
        self.scale = 0.0

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self.pressure = self._at(t1)
        self.scale = abs(self.pressure * enclosed_volume(x_t.whole, self.facets))

    def value(self, x: Positions) -> float:
        return -self.pressure * enclosed_volume(x.whole, self.facets)

    def gradient(self, x: Positions) -> np.ndarray:
        return -self.pressure * self.space.from_input(volume_gradient(x.whole, self.facets))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        across, sizes = self._edge_blocks(x)
        across, sizes = -weight * self.pressure * across, weight * abs(self.pressure) * sizes
        low, high = self.space.point_blocks[self._low], self.space.point_blocks[self._high]
        if into.projection != "abs":
            across = across if into.projection == "none" else across / 2
            into.add_pairs(low, high, across)
            into.add_pairs(high, low, np.ascontiguousarray(across.transpose(0, 2, 1)))
        if into.projection != "none":
            sizes = sizes if into.projection == "abs" else sizes / 2
            into.add_pairs(low, low, sizes)
            into.add_pairs(high, high, sizes)

    def _edge_blocks(self, x: Positions) -> tuple[np.ndarray, np.ndarray]:
        """For each edge V's block (d, d) between its lower and its higher end, and the absolute value of both ends'
        matrix: a block (d, d) that is the same at either end.
        """
        count = len(self._low)
        if self._opposite is None:
            turn = np.array([[0.0, 0.5], [-0.5, 0.0]])
            signs = np.bincount(self._edge, self._sign, minlength=count)
            return signs[:, None, None] * turn, 0.5 * np.abs(signs)[:, None, None] * np.eye(2)
        w = np.zeros((count, 3))
        np.add.at(w, self._edge, -self._sign[:, None] * x.whole[self._opposite])
        w /= 6.0
        across = np.zeros((count, 3, 3))
        across[:, [2, 0, 1], [1, 2, 0]], across[:, [1, 2, 0], [2, 0, 1]] = w, -w
        lengths = np.linalg.norm(w, axis=1)
        n = w / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        return across, lengths[:, None, None] * (np.eye(3) - n[:, :, None] * n[:, None, :])
