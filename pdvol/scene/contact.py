"""Contact between surfaces: the barrier and its friction."""

from dataclasses import dataclass

from pdvol.scene.checks import count, finite, positive, require
from pdvol.scene.lengths import Length, Relative, length


@dataclass(frozen=True)
class Barrier:
    """Contact without interpenetration: the area-weighted, convergent barrier (Li et al. 2023).

    Attributes
    ----------
    dhat : distance [m] at which contact begins to push
    stiffness : barrier stiffness as a fraction of the softest Young's modulus
    ccd : "additive", or "tight-inclusion": certified in exact arithmetic and many times slower
    """

    dhat: Length = Relative(1e-3)
    stiffness: float = 0.1
    ccd: str = "additive"

    def __post_init__(self):
        length("Barrier.dhat", self.dhat)
        positive("Barrier.stiffness", self.stiffness)
        require(self.ccd in ("additive", "tight-inclusion"), f"Barrier.ccd = {self.ccd!r} must be additive or tight-inclusion")


@dataclass(frozen=True)
class Friction:
    """Coulomb friction, smoothed below the sliding speed `eps_v` [m/s] and lagged (Li et al. 2020)."""

    mu: float
    eps_v: Length = Relative(1e-3)
    iterations: int = 1

    def __post_init__(self):
        finite("Friction.mu", self.mu, 0.0)
        length("Friction.eps_v", self.eps_v)
        count("Friction.iterations", self.iterations, 1)
