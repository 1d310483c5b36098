"""The base of the incremental potential's terms, and the positions at which they are evaluated."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pdvol.levels.script import Mover
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.domains import Domains
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks

# share of each gap, and of each cell's volume, that a step leaves at least: small, since the next step opens it again,
# but barriers and logarithms keep moderate derivatives
LEAST_LEFT = 0.1

# share of its gap, or of dhat, that a pair is expected to keep on a direction that brings it together: with less,
# expectations are stiffer than contact will be; with more, it takes more of them
PRESSED_GAP_SHARE = 0.5


def same(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two arrays (n, d) have the same numbers."""
    # where things move, the first number shows it: the whole comparison takes ten times as long
    return one is other or bool(len(one) == 0 or one[0, 0] == other[0, 0] and (one == other).all())


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
        self._moved: tuple[np.ndarray, float, Positions] | None = None  # the last direction, step, and their place
        self._derived: dict[Any, tuple[Any, Any]] = {}

    def get(self, key: Any, make: Callable[[], Any], version: Any = None) -> Any:
        """What `make()` derives from this state, made once for a key, which names what asks and for what, and for each
        version of all else that it depends on.
        """
        known = self._derived.get(key)
        if known is None or known[0] != version:
            known = self._derived[key] = version, make()
        return known[1]

    @cached_property
    def whole(self) -> np.ndarray:
        """(n, d): all positions in the input's order, on every rank. First use is collective."""
        return self.space.to_input(self.owned)

    @cached_property
    def local(self) -> np.ndarray:
        """(n_local, d), contiguous: owned and ghost positions. First use is collective."""
        return self.space.with_ghosts(self.owned)

    def moved(self, step: float, direction: np.ndarray) -> "Positions":
        """x + step * direction, direction (n_owned, d). The same object as the last one for the same direction, if that
        array is read-only: what terms derive from it is then found once.
        """
        if direction.flags.writeable:
            return Positions(self.space, self.owned + step * direction)
        if self._moved is None or self._moved[0] is not direction or self._moved[1] != step:
            self._moved = direction, step, Positions(self.space, self.owned + step * direction)
        return self._moved[2]


@dataclass(frozen=True, eq=False)
class Earlier:
    """A state before the step's start.

    Attributes
    ----------
    weight : in the start that rates are taken from (`Rates`)
    x : Positions
    time : [s]
    lags : [s] how late obstacles were
    """

    weight: float
    x: Positions
    time: float
    lags: Mapping[Mover, float]


@dataclass(frozen=True, eq=False)
class Rates:
    """How a rate of change at a step's end follows from there: (q - q~) / duration for a quantity q.

    Its start q~ is that of the step, q_t, plus the sum of weight (q_e - q_t) over earlier states e, if any. With none,
    rates are means over the step.

    Attributes
    ----------
    duration : [s]
    earlier : those that count
    """

    duration: float
    earlier: tuple[Earlier, ...] = ()

    def start(self, now: np.ndarray, of: Callable[[Earlier], np.ndarray]) -> np.ndarray:
        """q~ of a quantity that is `now` at the step's start, and `of(e)` in an earlier state e."""
        return now + sum((each.weight * (of(each) - now) for each in self.earlier), start=np.zeros_like(now))


def by_names(terms: "Sequence[Term]") -> "dict[str, Term]":
    """Terms by their names; further ones of the same name by `name 2`, `name 3`, ..."""
    found: dict[str, Term] = {}
    for term in terms:
        count = sum(other.name == term.name for other in found.values()) + 1
        found[term.name if count == 1 else f"{term.name} {count}"] = term
    return found


class Term(ABC):
    """A term E(x) [J] of the energy, the base also for those of a user's own. Terms do not know the time step's weight
    or supported rows: the integrator weighs them, Newton's method eliminates rows.

    A term defines `value` and `gradient`. By default there are no obstacles, friction or memory, every step is
    admissible, and the Hessian is left out. All calls are collective; values are the same on every rank, arrays hold
    this rank's rows.
    """

    name = "term"
    scale = 0.0  # [J] of parts that cancel in value(x), which its round-off is relative to
    stencils: Sequence[Domains] = ()  # domains between whose vertices it adds blocks of its Hessian

    @property
    def has_friction(self) -> bool:
        """Whether friction acts on this rank, as lagged."""
        return False

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        """Starts the step from t0 to t1 [s] at x_t: obstacles are at their places at t0, and friction is lagged at x_t.
        Rates are means over the step.

        `x_hat` is where the step will probably end; searches for contact use it.
        """

    def set_rates(self, rates: Rates) -> None:
        """After `begin_step`: rates of change in this step are those of the integrator."""

    def move_obstacles(self, time: float) -> None:
        """Moves obstacles to their places at `time` [s]."""

    def update_lag(self, x: Positions) -> None:
        """Lags friction at x: contact forces and directions are constant until the next call."""

    def end_step(self, x: Positions) -> None:
        """Ends the step at x. Collective."""

    @property
    def memory(self) -> Mapping[str, Any]:
        """What the next step needs to know of those before, as JSON; empty where that is nothing."""
        return {}

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Sets what `memory` gave."""

    @abstractmethod
    def value(self, x: Positions) -> float:
        """E(x) [J]; inf where x is not admissible."""

    @abstractmethod
    def gradient(self, x: Positions) -> np.ndarray:
        """dE/dx [N], shape (n_owned, d)."""

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        """Adds weight times d2E/dx2 [N/m], made positive semi-definite as `into.projection` says."""

    def max_step(
        self, x: Positions, direction: np.ndarray, until: float | None = None, gap_share: float = LEAST_LEFT
    ) -> float:
        """Largest step in [0, 1] along direction (n_owned, d) that stays admissible for this rank's cells and contacts,
        while obstacles move to their places at `until` [s]. Where contact ends it, `gap_share` of a gap is left.
        """
        return 1.0
