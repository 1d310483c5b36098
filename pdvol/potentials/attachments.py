r"""Springs between material points, and from material to points that move: E = sum of phi(l), l the length of a spring.

With f = phi' the Hessian of a spring of direction n is f' (c + (1 - c) n n'), c = f / (l f'). Forces act along springs.

Of attachments phi = k/2 (l - L)^2, L the rest length: bodies exchange neither momentum nor angular momentum that is not
their own. c = 1 - L / l is negative where the spring is pressed (l < L), and then is left out (clamp) or counted by its
size (abs). Every rank evaluates all springs from the same positions, so all agree on what breaks.

Of pulls phi = k s^2 (q - 1), q^2 = 1 + l^2 / s^2, about k l^2 / 2 where l is short. The force k l / q is below k s.
With a damper of time a, l is the length of r + a (r - r_t) / dt, r the spring's vector and r_t that at the step's
start, and E = phi / (1 + a / dt): the gradient has the same bound.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from pdvol.levels.attachments import BoundSprings, Pulls
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions, Term


class Springs(Term):
    """Springs of a level, whose vectors are sums of weights times positions; derived classes have their law."""

    def __init__(self, space: LevelSpace, points: np.ndarray, weights: np.ndarray):
        self.space = space
        self._connect(points, weights)

    def _connect(self, points: np.ndarray, weights: np.ndarray) -> None:
        """Takes springs with these points and weights (k, m)."""
        count, corners = points.shape
        self._points, self._weights = points, weights
        rows = np.repeat(np.arange(count), corners)
        self._ends = csr_array((weights.ravel(), (rows, points.ravel())), shape=(count, len(self.space.mesh.points)))
        blocks = self.space.point_blocks[points]
        pairs = np.broadcast_to(blocks[:, :, None], (count, corners, corners))
        self._rows, self._columns = pairs.ravel(), pairs.transpose(0, 2, 1).ravel()
        self._products = weights[:, :, None] * weights[:, None, :]

    def _vectors(self, x: Positions) -> np.ndarray:
        """(k, d) [m]."""
        # weights sum to zero; from differences, since coordinates far from the origin have lost digits of a length
        return self._from(x, x.whole[self._points[:, 0]])

    def _from(self, x: Positions, origin: np.ndarray) -> np.ndarray:
        """(k, d) [m]: sums of weights times positions less those of the springs' origins (k, d)."""
        return np.einsum("kc,kcd->kd", self._weights, x.whole[self._points] - origin[:, None])

    def _lengths(self, x: Positions) -> tuple[np.ndarray, np.ndarray]:
        """Lengths (k,) [m] and directions (k, d); a spring of no length has no direction, and pulls with no force."""
        along = self._vectors(x)
        lengths = np.linalg.norm(along, axis=1)
        return lengths, along / np.where(lengths > 0.0, lengths, 1.0)[:, None]

    def _pull(self, lengths: np.ndarray) -> np.ndarray:
        """f (k,) [N]."""
        raise NotImplementedError

    def _stiffnesses(self, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """f' (k,) [N/m], and c (k,)."""
        raise NotImplementedError

    def gradient(self, x: Positions) -> np.ndarray:
        lengths, n = self._lengths(x)
        return self.space.from_input(self._ends.T @ (self._pull(lengths)[:, None] * n))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        if not len(self._points):
            return
        lengths, n = self._lengths(x)
        d, (along, across) = self.space.dim, self._stiffnesses(lengths)
        if into.projection != "none":
            across = np.abs(across) if into.projection == "abs" else np.maximum(across, 0.0)
        middle = across[:, None, None] * np.eye(d) + (1.0 - across)[:, None, None] * n[:, :, None] * n[:, None, :]
        middle = (weight * along)[:, None, None] * middle
        blocks = self._products[..., None, None] * middle[:, None, None, :, :]
        into.add_pairs(self._rows, self._columns, np.ascontiguousarray(blocks.reshape(-1, d, d)))


class Attachments(Springs):
    """All springs between bodies of a level.

    Parameters
    ----------
    space : LevelSpace
    springs : BoundSprings

    Attributes
    ----------
    broken : (k,) bool
    """

    name = "attachment"

    def __init__(self, space: LevelSpace, springs: BoundSprings):
        super().__init__(space, springs.points, springs.weights)
        self.springs, self.broken = springs, np.zeros(len(springs.points), dtype=bool)

    @property
    def memory(self) -> Mapping[str, Any]:
        """The numbers of the springs that have broken; empty where none has."""
        return {"broken": np.flatnonzero(self.broken).tolist()} if self.broken.any() else {}

    def restore(self, memory: Mapping[str, Any]) -> None:
        self.broken[:] = False
        self.broken[np.asarray(memory.get("broken", ()), dtype=int)] = True

    def end_step(self, x: Positions) -> None:
        lengths, _ = self._lengths(x)
        self.broken |= self._stiffness * (lengths - self.springs.rest_length) > self.springs.strength

    @property
    def _stiffness(self) -> np.ndarray:
        return np.where(self.broken, 0.0, self.springs.stiffness)

    def value(self, x: Positions) -> float:
        lengths, _ = self._lengths(x)
        return float(0.5 * self._stiffness @ (lengths - self.springs.rest_length) ** 2)

    def _pull(self, lengths: np.ndarray) -> np.ndarray:
        return self._stiffness * (lengths - self.springs.rest_length)

    def _stiffnesses(self, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rest = self.springs.rest_length
        across = 1.0 - np.divide(rest, lengths, out=np.ones_like(rest), where=lengths > 0.0)
        across[(lengths == 0.0) & (rest == 0.0)] = 1.0
        return self._stiffness, across


class Pulling(Springs):
    """The pulls of a level, those that act in the present span. Where none does, it adds nothing.

    Parameters
    ----------
    space : LevelSpace
    pulls : Pulls
    """

    name = "pull"

    def __init__(self, space: LevelSpace, pulls: Pulls):
        super().__init__(space, np.zeros((0, 1), dtype=int), np.zeros((0, 1)))
        self._pulls = pulls

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        acting = list(self._pulls.acting(t0, t1).values())
        bound = [self._pulls.bound(pull) for pull in acting]
        size = max((len(each.points) for each in bound), default=1)
        points, weights = np.zeros((len(bound), size), dtype=int), np.zeros((len(bound), size))
        for i, each in enumerate(bound):
            points[i], weights[i, : len(each.weights)] = np.resize(each.points, size), each.weights
        self._connect(points, weights)
        law = [(each.stiffness, each.most / each.stiffness, each.damping / (t1 - t0)) for each in bound]
        self._k, self._s, self._share = np.array(law).reshape(-1, 3).T
        begin, self._point = (np.array([p.at(t) for p in acting]).reshape(-1, self.space.dim) for t in (t0, t1))
        self._start = self._from(x_t, begin) if acting else begin

    def _vectors(self, x: Positions) -> np.ndarray:
        now = self._from(x, self._point) if len(self._point) else self._point
        return now + self._share[:, None] * (now - self._start)

    def _root(self, lengths: np.ndarray) -> np.ndarray:
        return np.hypot(1.0, lengths / self._s)

    def value(self, x: Positions) -> float:
        lengths, _ = self._lengths(x)
        return float(self._k * lengths / (1.0 + self._share) @ (lengths / (1.0 + self._root(lengths))))

    def _pull(self, lengths: np.ndarray) -> np.ndarray:
        return self._k * lengths / self._root(lengths)

    def _stiffnesses(self, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        root = self._root(lengths)
        return (1.0 + self._share) * self._k / root**3, root**2
