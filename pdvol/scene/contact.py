"""Contact between surfaces: the barrier and its friction."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

from pdvol.scene.checks import count, finite, plain, positive, require
from pdvol.scene.element import Element
from pdvol.scene.values import Length, Relative, length

# fraction of Young's modulus: with 0.1, which the authors of the convergent formulation recommend, fast impacts close
# gaps to 1e-3 dhat, where Newton's steps are short
STIFFNESS = 0.3


@dataclass(frozen=True, repr=False)
class Pascal(Element):
    """A stiffness in pascal, where a number is a fraction of the softest Young's modulus.

    Attributes
    ----------
    pascals : [Pa]
    """

    pascals: float
    checks = {"pascals": positive}


def _stiffness(name: str, value: Any) -> None:
    if not isinstance(value, Pascal):
        positive(name, value)


@dataclass(frozen=True, repr=False)
class Barrier(Element):
    """Contact without interpenetration: a barrier weighted by area, the same on every level (Li et al. 2023).

    Attributes
    ----------
    dhat : distance [m] at which contact begins to push
    stiffness : as a fraction of the softest Young's modulus, or `Pascal`
    """

    dhat: Length = Relative(1e-3)
    stiffness: float | Pascal = STIFFNESS

    checks = {"dhat": length, "stiffness": _stiffness}

    def kappa(self, softest: float) -> float:
        """Its stiffness [Pa], given the softest Young's modulus [Pa]."""
        return self.stiffness.pascals if isinstance(self.stiffness, Pascal) else self.stiffness * softest


@dataclass(frozen=True, repr=False)
class Friction(Element):
    """Coulomb friction, smoothed below a sliding speed and lagged (Li et al. 2020).

    Attributes
    ----------
    mu : coefficient of friction
    eps_v : sliding speed [m/s] below which friction is smoothed
    iterations : how often a step may be solved with forces and directions of friction lagged anew; fewer where
        `tolerance` is met before
    pairs : coefficients of their own by the names of bodies and obstacles, as {("ball", "floor"): 0.9}; kept as ((name,
        name, mu), ...)
    tolerance : change of the friction forces by lagging them anew, relative to them, that counts as converged
    """

    mu: float
    eps_v: Length = Relative(1e-3)
    iterations: int = 1
    pairs: Mapping[tuple[str, str], float] | Sequence[tuple[str, str, float]] = ()
    tolerance: float = 1e-2

    checks = {
        "mu": partial(finite, lowest=0.0),
        "eps_v": length,
        "iterations": partial(count, lowest=1),
        "tolerance": positive,
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "pairs", _triples(self.pairs))

    def between(self, one: str, other: str) -> float:
        """The coefficient for two names."""
        return next((mu for a, b, mu in self.triples if {a, b} == {one, other}), self.mu)

    @property
    def triples(self) -> tuple[tuple[str, str, float], ...]:
        """`pairs`, as they are kept."""
        return cast(tuple[tuple[str, str, float], ...], self.pairs)


def _triples(pairs: Mapping | Sequence) -> tuple[tuple[str, str, float], ...]:
    """`Friction.pairs` as ((name, name, mu), ...), checked."""
    shape = 'Friction.pairs must look like {("ball", "floor"): 0.9}'
    listed = (
        [(names, plain(mu)) for names, mu in pairs.items()]
        if isinstance(pairs, Mapping)
        else [(tuple(p[:-1]), plain(p[-1])) for p in pairs]
    )
    for names, mu in listed:
        require(
            isinstance(names, tuple) and len(names) == 2 and all(isinstance(name, str) for name in names),
            f"{shape}, not {names!r}",
        )
        finite(f"Friction.pairs[{names}]", mu, 0.0)
    require(len({frozenset(names) for names, _ in listed}) == len(listed), "Friction.pairs names a pair twice")
    return tuple((*names, mu) for names, mu in listed)
