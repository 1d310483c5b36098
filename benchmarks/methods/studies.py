"""What `methods.py` compares: for each study a demo, its parameters and the cases that are run of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pdvol.studio.draw.views import STANDARD_SHOT, Shot

DEMOS = Path(__file__).resolve().parents[2] / "demos"


@dataclass(frozen=True)
class Case:
    """One run of a study's scene.

    Attributes
    ----------
    method, prolongation : as `pdvol run` takes them
    settings : what `--set` would give
    """

    method: str
    prolongation: str = "barycentric"
    settings: dict = field(default_factory=dict)

    @property
    def name(self) -> str:
        """`tracks barycentric weight=0.1`."""
        return " ".join([self.method, self.prolongation, *(f"{key}={value:g}" for key, value in self.settings.items())])


@dataclass(frozen=True)
class Study:
    """A demo and its cases.

    Attributes
    ----------
    demo : file name without its ending
    cases : tuple of Case
    steps, levels : how many are run
    figures : of "shapes" (the finest levels beside each other), "crossings" (the same, with what crosses in red),
        "sweep" (all levels for each weight), "curves" (consistency over time for each weight) and "metrics" (of
        progressive runs over time, by interpolant)
    moments : steps that the figure shows
    across : pictures side by side
    settings : of all cases; the paper's model where nothing else is given
    shot : how figures are seen
    """

    demo: str
    cases: tuple[Case, ...]
    steps: int
    levels: int
    figures: tuple[str, ...]
    moments: tuple[int, ...]
    across: int = 6
    settings: Mapping = field(default_factory=lambda: {"model": "paper"})
    shot: Shot = STANDARD_SHOT


def pulled(*weights: float) -> list[Case]:
    """TRACKS with so many weights."""
    return [Case("tracks", settings={"weight": w}) for w in weights]


INTERPOLANTS = ("barycentric", "biharmonic", "phong")
EVERYTHING = (
    Case("direct"),
    *(Case("progressive", name) for name in INTERPOLANTS),
    *(Case("embedded", name) for name in INTERPOLANTS),
    *pulled(0.025, 0.4),
)
PHONG = tuple(Case(method, name) for method in ("embedded", "progressive") for name in ("barycentric", "phong"))
EMBEDDED = tuple(Case(m, settings={"soft": soft}) for soft in (True, False) for m in ("embedded", "progressive"))
LETTER = Shot("1.0,0.5,0.05:0.0,0.42,0.0", cut="x=0.03")
LITERAL = 0.025 * 0.04**2
"""w = 0.025 if the paper's equation 4 is taken word for word, where w is a frequency squared: w dt^2 beside the
inertia's 1/2.
"""
WEIGHED = tuple(Case("progressive", settings={"consistency": w}) for w in (0.0, LITERAL, 0.025, 0.2, 0.4, 0.6))
DEFAULTS = tuple(case for case in WEIGHED if case.settings["consistency"] != LITERAL)

STUDIES = {
    "rope_drop": Study("rope_drop", EVERYTHING, 150, 5, ("shapes", "metrics"), (52, 89, 150)),
    "drop": Study("drop", EVERYTHING, 70, 2, ("shapes",), (40, 60)),
    "phong": Study("phong", PHONG, 45, 2, ("shapes",), (45,), across=3),
    "dice_and_wizard": Study("dice_and_wizard", EMBEDDED, 60, 2, ("crossings",), (60,), across=3, shot=LETTER),
    "tracks": Study("tracks", (Case("progressive"), *pulled(0.0025, 0.025, 0.2, 0.6)), 120, 2, ("shapes",), (44, 120)),
    "slit_array": Study("slit_array", WEIGHED, 150, 8, ("sweep", "curves"), (44, 142)),
    "slit_array_defaults": Study("slit_array", DEFAULTS, 150, 8, ("sweep", "curves"), (142,), settings={}),
}
