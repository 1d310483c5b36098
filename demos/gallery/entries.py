"""What the gallery shows: one entry a demo, at full size, and small for tests.

A demo of the gallery has a function `claim(run)` beside its `scene`. It gives a list of (sentence, whether it holds)
for a stored run: what the demo is there to show, with the figures of this run.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

DEMOS = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Further:
    """One more film of a page, with a colour that means something.

    Attributes
    ----------
    name : of the film, after that of the entry; a name in `further.SUBJECTS`
    title : of its part of the page
    about : Markdown: what to look at, and what was learned
    view, turn, cut, size, slow : as those of an entry
    """

    name: str
    title: str
    about: str
    view: str = ""
    turn: float = 0.0
    cut: str = ""
    size: tuple[int, int] = (1200, 460)
    slow: tuple[float, float] | None = None


@dataclass(frozen=True)
class Variant:
    """The same demo once more with other settings: a run, a film and a table of its own on the page.

    Attributes
    ----------
    name : of the film and of the run, after that of the entry
    title : of its part of the page
    about : Markdown: what to look at, and what was learned
    settings : of the scene, instead of the entry's
    direct : whether it has a second run, where the entry has one
    """

    name: str
    title: str
    about: str
    settings: Mapping[str, Any]
    direct: bool = True


@dataclass(frozen=True)
class Entry:
    """A demo in the gallery.

    Attributes
    ----------
    name : of demos/NAME.py, of its page and of its run
    title : of its page
    about : Markdown: what to look at, and what was learned
    small : what tests change to run it within seconds
    settings : of the scene, as in the gallery
    finest : level of the gallery's run; the scene's finest when None
    view : where films and pictures are seen from (`pdvol render --camera`)
    turn : of the camera further about the vertical [degrees]
    cut : what films and pictures take away (`pdvol render --cut`)
    drawn : whether bodies that carry render meshes are drawn as these
    direct : whether the page says how far levels part that are simulated each on its own; a second run
    binding : whether the page shows how level 1 is bound to level 0
    slow : first and last second of what films show in slow motion, a stored state a frame
    size : width and height of the film [pixels]
    moment : second shown on the contact sheet
    further : more films of the page
    paper : the paper's figure that it is for, where there is one
    variants : more rows of the page
    meeting : two bodies, by their numbers; the page compares how near they come with what embedding would give
    row : what the entry is called beside its variants
    demo : name of the demo, where it is not that of the page
    """

    name: str
    title: str
    about: str
    small: Mapping[str, Any]
    settings: Mapping[str, Any] = field(default_factory=dict)
    finest: int | None = None
    view: str = ""
    turn: float = 0.0
    cut: str = ""
    drawn: bool = False
    direct: bool = False
    binding: bool = False
    slow: tuple[float, float] | None = None
    size: tuple[int, int] = (1200, 440)
    moment: float = 0.5
    further: tuple[Further, ...] = ()
    paper: str = ""
    variants: tuple[Variant, ...] = ()
    meeting: tuple[int, int] | None = None
    row: str = ""
    demo: str = ""

    @property
    def file(self) -> Path:
        """The scene file."""
        return DEMOS / f"{self.demo or self.name}.py"

    def varied(self, variant: Variant) -> "Entry":
        """The entry of a variant: its file is the same, its run and its film have the variant's name as well."""
        return replace(
            self,
            name=f"{self.name}_{variant.name}",
            title=f"{self.title}: {variant.title}",
            about=variant.about,
            settings=variant.settings,
            direct=self.direct and variant.direct,
            demo=self.name,
            row=variant.name,
            variants=(),
            further=(),
        )
