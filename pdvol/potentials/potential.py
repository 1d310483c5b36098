"""What every term of the incremental potential offers, and the positions it is evaluated at."""

from functools import cached_property
from typing import Protocol

import numpy as np

from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks

KEPT = 0.1
"""What a step that contact ends leaves of each gap at least. It may close nine tenths, for the next one opens it again.
"""

KEPT_PRESSED = 0.5
"""The same where scripted motions press on, perhaps from several sides: gaps would shrink and shrink there, and bodies
that slide past one of 1e-6 dhat are stuck, hundreds of steps each ended by it.
"""


class Positions:
    """One configuration of a level: x on this rank, and what terms derive from it at most once.

    Attributes
    ----------
    space : LevelSpace
    owned : (n_owned, d) float64 [m]
        This rank's positions; not to be written to.
    """

    def __init__(self, space: LevelSpace, owned: np.ndarray):
        self.space = space
        self.owned = np.ascontiguousarray(owned, dtype=np.float64).reshape(space.n_owned, space.dim)

    @cached_property
    def whole(self) -> np.ndarray:
        """(n, d): all positions in the input's order, on every rank. First use is collective."""
        return self.space.to_input(self.owned)

    @cached_property
    def local(self) -> np.ndarray:
        """(n_local, d), contiguous: owned and ghost positions. First use is collective."""
        return self.space.with_ghosts(self.owned)

    def moved(self, step: float, direction: np.ndarray) -> "Positions":
        """x + step * direction, direction (n_owned, d)."""
        return Positions(self.space, self.owned + step * direction)


class Potential(Protocol):
    """A term E(x) [J]. Terms never see the time step's weight or supported rows: the integrator weighs, newton
    eliminates.

    All calls are collective; values are the same on every rank, arrays hold this rank's rows.
    """

    name: str
    rubs: bool  # whether friction acts on this rank, as lagged
    scale: float  # [J] of parts that cancel in value(x), which its round-off is relative to

    def expect(self, x_hat: Positions) -> None:
        """Before `begin_step`: where the step is likely to end, give or take; for searches only."""

    def begin_step(self, x_t: Positions, t0: float, t1: float) -> None:
        """Starts the step from t0 to t1 [s] at x_t, with obstacles at their t0 places, and lags there."""

    def place(self, time: float) -> None:
        """Puts obstacles where they are at `time` [s]."""

    def lag(self, x: Positions) -> None:
        """Freezes lagged quantities (friction) at x."""

    def value(self, x: Positions) -> float:
        """E(x) [J]; inf where x is not admissible."""

    def gradient(self, x: Positions) -> np.ndarray:
        """dE/dx [N], shape (n_owned, d)."""

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        """Adds weight times d2E/dx2 [N/m], made positive semi-definite as `into.positive` says."""

    def max_step(self, x: Positions, direction: np.ndarray, until: float | None = None, keep: float = KEPT) -> float:
        """Largest step in [0, 1] along direction (n_owned, d) that stays admissible for what this rank sees, while
        obstacles go where they are at `until` [s]. Where contact is what ends it, `keep` of a gap is left.
        """


class Term:
    """Default answers, for terms that need nothing of the kind."""

    name = "term"
    rubs = False
    scale = 0.0

    def expect(self, x_hat: Positions) -> None:
        pass

    def begin_step(self, x_t: Positions, t0: float, t1: float) -> None:
        pass

    def place(self, time: float) -> None:
        pass

    def lag(self, x: Positions) -> None:
        pass

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        pass

    def max_step(self, x: Positions, direction: np.ndarray, until: float | None = None, keep: float = KEPT) -> float:
        return 1.0
