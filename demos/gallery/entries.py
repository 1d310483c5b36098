"""What an entry of the gallery has. Its words are on its page, docs/gallery/NAME.md, above the film.

A demo of the gallery has a function `claim(run)` beside its `scene`. It gives a list of (sentence, whether it holds)
for a stored run: what the demo is there to show, with the figures of this run.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

DEMOS = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Variant:
    """The same demo once more with other `settings`: a run, a film and a table on the same page. `name` and `title`
    follow those of the entry; `direct` is whether it has a second run, where the entry has one.
    """

    name: str
    title: str
    settings: Mapping[str, Any]
    direct: bool = True


@dataclass(frozen=True)
class Entry:
    """A demo in the gallery.

    Attributes
    ----------
    name, title : of demos/NAME.py, of its page and of its run; of the page
    settings, small : of the scene in the gallery; what tests change to run it within seconds
    view, turn, cut : of films and pictures: `pdvol render --camera`, degrees about the vertical, and `--cut`
    direct : whether a second run says how far levels part that are simulated each on its own
    beside : whether the picture, and a short film, have that run's levels above the refined ones
    binding : whether the page has a picture of how level 1 is bound to level 0
    slow : first and last second of films in slow motion, a stored state a frame
    size, most, moment : of the film [pixels], [bytes] at most; second shown on the contact sheet
    variants : more runs of the page
    demo : name of the demo, where it is not that of the page
    """

    name: str
    title: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    small: Mapping[str, Any] = field(default_factory=dict)
    view: str = ""
    turn: float = 0.0
    cut: str = ""
    direct: bool = True
    beside: bool = False
    binding: bool = False
    slow: tuple[float, float] | None = None
    size: tuple[int, int] = (1200, 440)
    most: int = 400_000
    moment: float = 0.5
    variants: tuple[Variant, ...] = ()
    demo: str = ""

    @property
    def file(self) -> Path:
        """The scene file."""
        return DEMOS / f"{self.demo or self.name}.py"

    @property
    def rows(self) -> "tuple[Entry, ...]":
        """The entry, and an entry for each of its variants: their file is the same, run and film have both names."""
        varied = (
            replace(
                self,
                name=f"{self.name}_{variant.name}",
                title=f"{self.title}: {variant.title}",
                settings=variant.settings,
                direct=self.direct and variant.direct,
                demo=self.name,
                variants=(),
            )
            for variant in self.variants
        )
        return (self, *varied)
