r"""Springs between material points: E = sum of k/2 (l - L)^2, l the length of a spring and L its rest length.

Forces act along the springs, so bodies exchange neither momentum nor angular momentum that is not their own. The
Hessian of one spring of direction n is k n n' + k (1 - L / l) (1 - n n'). Its second part is negative where the spring
is pressed (l < L), and then is left out (clamp) or counted by its size (abs). Every rank evaluates all springs from the
same positions, so all agree on what breaks.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from pdvol.levels.attachments import BoundSprings
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions, Term


class Attachments(Term):
    """All springs of a level.

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
        self.space, self.springs = space, springs
        count, corners = springs.points.shape
        self.broken = np.zeros(count, dtype=bool)
        rows = np.repeat(np.arange(count), corners)
        self._ends = csr_array(
            (springs.weights.ravel(), (rows, springs.points.ravel())), shape=(count, len(space.mesh.points))
        )
        blocks = space.point_blocks[springs.points]
        pairs = np.broadcast_to(blocks[:, :, None], (count, corners, corners))
        self._rows, self._columns = pairs.ravel(), pairs.transpose(0, 2, 1).ravel()
        self._products = springs.weights[:, :, None] * springs.weights[:, None, :]

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

    def _lengths(self, x: Positions) -> tuple[np.ndarray, np.ndarray]:
        """Lengths (k,) [m] and directions (k, d); a spring of no length has no direction, and pulls with no force."""
        points = x.whole[self.springs.points]
        # weights sum to zero; from differences, since coordinates far from the origin have lost digits of a length
        along = np.einsum("kc,kcd->kd", self.springs.weights, points - points[:, :1])
        lengths = np.linalg.norm(along, axis=1)
        return lengths, along / np.where(lengths > 0.0, lengths, 1.0)[:, None]

    def value(self, x: Positions) -> float:
        lengths, _ = self._lengths(x)
        return float(0.5 * self._stiffness @ (lengths - self.springs.rest_length) ** 2)

    def gradient(self, x: Positions) -> np.ndarray:
        lengths, n = self._lengths(x)
        pull = self._stiffness * (lengths - self.springs.rest_length)
        return self.space.from_input(self._ends.T @ (pull[:, None] * n))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        lengths, n = self._lengths(x)
        d, rest = self.space.dim, self.springs.rest_length
        across = 1.0 - np.divide(rest, lengths, out=np.ones_like(rest), where=lengths > 0.0)
        across[(lengths == 0.0) & (rest == 0.0)] = 1.0
        if into.projection != "none":
            across = np.abs(across) if into.projection == "abs" else np.maximum(across, 0.0)
        middle = across[:, None, None] * np.eye(d) + (1.0 - across)[:, None, None] * n[:, :, None] * n[:, None, :]
        middle = (weight * self._stiffness)[:, None, None] * middle
        blocks = self._products[..., None, None] * middle[:, None, None, :, :]
        into.add_pairs(self._rows, self._columns, np.ascontiguousarray(blocks.reshape(-1, d, d)))
