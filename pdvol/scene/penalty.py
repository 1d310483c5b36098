"""How firmly levels are held to the level below them."""

from dataclasses import dataclass

from pdvol.scene.checks import finite, keep_plain
from pdvol.scene.representation import one_line


@dataclass(frozen=True)
class Penalty:
    """Weights w of w |x - P x_c|^2_M, x_c the coarser level's positions at the end of the step (design, section 2;
    paper 3.2.3).

    It stands beside the inertia's 1/2 |x - x_hat|^2_M, so w has no unit: w = 0.025 is a twentieth of the inertia. A
    march that is not named below has no such term.

    Attributes
    ----------
    consistency : of the progressive march
    weight : of tracks
    """

    consistency: float = 0.0
    weight: float = 0.0
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "consistency", "weight")
        finite("Penalty.consistency", self.consistency, 0.0)
        finite("Penalty.weight", self.weight, 0.0)

    def of(self, method: str) -> float:
        """The weight that a method's levels are held with."""
        return {"progressive": self.consistency, "tracks": self.weight}.get(method, 0.0)
