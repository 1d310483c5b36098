"""What `methods.py` compares: for each study a demo, its parameters and the cases that are run of it."""

from dataclasses import dataclass, field
from pathlib import Path

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
    figures : of "shapes" (the finest levels beside each other), "sweep" (all levels for each weight), "curves"
        (consistency over time for each weight) and "metrics" (of progressive runs over time, by interpolant)
    moments : steps that the figure shows
    """

    demo: str
    cases: tuple[Case, ...]
    steps: int
    levels: int
    figures: tuple[str, ...] = ("shapes",)
    moments: tuple[int, ...] = ()


INTERPOLANTS = ("barycentric", "biharmonic", "phong")
EVERYTHING = (
    Case("direct"),
    *(Case("progressive", name) for name in INTERPOLANTS),
    *(Case("embedded", name) for name in INTERPOLANTS),
    *(Case("tracks", settings={"weight": w}) for w in (0.025, 0.4)),
)
WEIGHTS = (0.0, 0.025, 0.2, 0.4, 0.6)
LITERAL = 0.025 * 0.04**2
"""w = 0.025 if the paper's equation 4 is taken word for word, where w is a frequency squared: w dt^2 beside the
inertia's 1/2.
"""

STUDIES = {
    "rope_drop": Study(
        "rope_drop", EVERYTHING, steps=150, levels=5, figures=("shapes", "metrics"), moments=(52, 89, 150)
    ),
    "drop": Study("drop", EVERYTHING, steps=70, levels=2, moments=(40, 60)),
    "phong": Study(
        "phong",
        tuple(Case(method, name) for method in ("embedded", "progressive") for name in ("barycentric", "phong")),
        steps=40,
        levels=2,
        moments=(25, 40),
    ),
    "tracks": Study(
        "tracks",
        (Case("progressive"), *(Case("tracks", settings={"weight": w}) for w in (0.0025, 0.025, 0.2, 0.6))),
        steps=120,
        levels=2,
        moments=(44, 120),
    ),
    "slit_array": Study(
        "slit_array",
        tuple(Case("progressive", settings={"consistency": w}) for w in (*WEIGHTS[:1], LITERAL, *WEIGHTS[1:])),
        steps=150,
        levels=8,
        figures=("sweep", "curves"),
        moments=(44, 142),
    ),
}
