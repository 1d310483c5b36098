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

from pdvol.levels.attachments import BoundPull, BoundSprings, Pulls
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions, Term


class SpringTerm(Term):
    """Springs of a level, whose vectors are sums of weights times positions; derived classes have their law."""

    _version = 0  # of all that vectors depend on, but positions

    def __init__(self, space: LevelSpace, points: np.ndarray, weights: np.ndarray):
        self.space = space
        self._connect(points, weights)

    def _connect(self, points: np.ndarray, weights: np.ndarray) -> None:
        """Takes springs with these points and weights (k, m)."""
        count, corners = points.shape
        self._points, self._weights = points, weights
        rows = np.repeat(np.arange(count), corners)
        ends = csr_array((weights.ravel(), (rows, points.ravel())), shape=(count, len(self.space.mesh.points)))
        self._onto = ends.T  # of forces of springs, those on points
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
        along = x.get((self, "vectors"), lambda: self._vectors(x), self._version)
        lengths = np.linalg.norm(along, axis=1)
        return lengths, along / np.where(lengths > 0.0, lengths, 1.0)[:, None]

    def _law(self, lengths: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """E [J]; of each spring f [N], f' [N/m] and c, (k,)."""
        raise NotImplementedError

    def value(self, x: Positions) -> float:
        return self._law(self._lengths(x)[0])[0]

    def gradient(self, x: Positions) -> np.ndarray:
        lengths, n = self._lengths(x)
        return self.space.from_input(self._onto @ (self._law(lengths)[1][:, None] * n))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        if not len(self._points):
            return
        lengths, n = self._lengths(x)
        d, (_, _, along, across) = self.space.dim, self._law(lengths)
        if into.projection != "none":
            across = np.abs(across) if into.projection == "abs" else np.maximum(across, 0.0)
        middle = across[:, None, None] * np.eye(d) + (1.0 - across)[:, None, None] * n[:, :, None] * n[:, None, :]
        middle = (weight * along)[:, None, None] * middle
        blocks = self._products[..., None, None] * middle[:, None, None, :, :]
        into.add_pairs(self._rows, self._columns, np.ascontiguousarray(blocks.reshape(-1, d, d)))


class Attachments(SpringTerm):
    """All springs between bodies of a level.

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
        self.broken |= self._law(lengths)[1] > self.springs.strength

    def _law(self, lengths: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        rest, stiffness = self.springs.rest_length, np.where(self.broken, 0.0, self.springs.stiffness)
        across = 1.0 - np.divide(rest, lengths, out=np.ones_like(rest), where=lengths > 0.0)
        across[(lengths == 0.0) & (rest == 0.0)] = 1.0
        energy = float(0.5 * stiffness @ (lengths - rest) ** 2)
        return energy, stiffness * (lengths - rest), stiffness, across


class Pulling(SpringTerm):
    """The pulls of a level, those that act in the present span. Where none does, it adds nothing."""

    name = "pull"

    def __init__(self, space: LevelSpace, pulls: Pulls):
        self.space, self._pulls = space, pulls
        self._hold([])

    def _hold(self, bound: list[BoundPull]) -> None:
        size = max((len(weights) for _, weights, _ in bound), default=1)
        points, weights = np.zeros((len(bound), size), dtype=int), np.zeros((len(bound), size))
        for i, (its, shares, _) in enumerate(bound):
            points[i], weights[i, : len(shares)] = np.resize(its, size), shares
        self._connect(points, weights)
        self._k, self._s, self._damping = np.array([law for _, _, law in bound]).reshape(-1, 3).T
        self._bound = bound

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        acting = list(self._pulls.acting(t0, t1).values())
        bound = [self._pulls.bound(pull) for pull in acting]
        self._version += 1
        if [id(each) for each in bound] != [id(each) for each in self._bound]:
            self._hold(bound)
        self._share = self._damping / (t1 - t0)
        begin, self._point = (np.array([p.at(t) for p in acting]).reshape(-1, self.space.dim) for t in (t0, t1))
        self._start = self._from(x_t, begin) if acting else begin

    def _vectors(self, x: Positions) -> np.ndarray:
        now = self._from(x, self._point) if len(self._point) else self._point
        return now + self._share[:, None] * (now - self._start)

    def _law(self, lengths: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        k, more, root = self._k, 1.0 + self._share, np.hypot(1.0, lengths / self._s)
        energy = float(k * lengths / more @ (lengths / (1.0 + root)))
        return energy, k * lengths / root, more * k / root**3, root**2
