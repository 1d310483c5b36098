"""The Markdown page of an entry, and the gallery's index.

What stands between a heading and the film or picture below it is written by hand; all else is made.
"""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from demos.gallery.entries import Entry
from demos.gallery.film import FRAMES_PER_SECOND
from demos.gallery.shots import commits, table_of_shots
from pdvol.runs.scene_file import load_shot
from pdvol.store.files import write_bytes
from pdvol.store.reader import Run

RUNS = "runs/gallery"  # folder of the gallery's runs
BINDING, BOUND = "How level 1 is bound to level 0", "Which cell each cell is bound to"
TO_WRITE = "To be written: what to look at, and what was learned."
"""The words of a page that has none."""
MEETINGS = (
    "At the end. Gaps are distances from vertices of the one surface to the other surface, negative inside it. Embedded"
    " means that level 1 only follows level 0, by the same interpolation."
)
"""What stands above the table of how near bodies come."""
INDEX = f"""# Gallery

![all demos of the gallery](sheet.png)

Each page, its film and its table are made from a stored run by `./run python -m demos.gallery NAME`, which simulates
first what is not stored. `{RUNS}/NAME.html` plays it. A demo's claim is checked on the stored run when its page is
made, and on small levels by the tests.

In the tables of pages, times, iterations and distances from the level below are means over all steps. Parts of the
time are assembly, contact, collision detection, linear solves and the rest. Distances are root mean squares over the
mass, from the coarser level prolonged to the finer one; those from level 0 are at the end. With `--method direct` each
level is simulated on its own. Intersections are counted by `pdvol verify`, which is independent of the solver.

## What a preview saves

Means over all steps of a level, CPU time on one core, beside other jobs. A level solves the same problem as its direct
simulation: the same forces, contact and friction, from another prediction. `./run python -m demos.gallery --check`
says which of these numbers are older than the solver.

"""
"""The gallery's index, above its table."""


@dataclass(frozen=True)
class Shown:
    """An entry with its runs, and what was found on them.

    Attributes
    ----------
    entry, run : the entry, and its stored run
    levels : the table of levels
    claims : sentences of the demo's claim, and whether they hold
    made, made_directly : commits and machine of the run, and of that by the direct method; empty where unknown
    """

    entry: Entry
    run: Run
    levels: str
    claims: Sequence[tuple[str, bool]]
    made: Mapping[str, Any]
    made_directly: Mapping[str, Any]


def write_entry(shown: Shown, out: Path, variants: Sequence[Shown] = (), meetings: str = "") -> Path:
    """The page of an entry beside its film.

    Parameters
    ----------
    variants : those of the entry, in its order
    meetings : the table of how near bodies come, of the entry and its variants
    """
    entry, run = shown.entry, shown.run
    before = out.read_text(encoding="utf-8") if out.is_file() else ""
    parts = [
        _headed(before, f"# {entry.title}", f"{entry.title}: the levels beside each other", f"{entry.name}.webp"),
        f"*{run.info['steps'] * run.dt:.3g} s, {run.info['steps']} steps of {run.dt:g} s; {_speed(entry, run.dt)}."
        f" [Picture]({entry.name}.png).*",
        "## What it shows\n\n" + _claims(shown),
        f"## The levels\n\n{shown.levels}",
    ]
    if entry.binding:
        parts.append(_headed(before, f"## {BINDING}", BINDING, f"{entry.name}_binding.png"))
    if entry.bound:
        parts.append(_headed(before, f"## {BOUND}", BOUND, f"{entry.name}_bound.webp"))
    for variant in variants:
        title = variant.entry.title.rpartition(": ")[2]
        film = f"{variant.entry.name}.webp"
        parts += [
            _headed(before, f"## {title}", f"{title}: the levels beside each other", film),
            _claims(variant),
            variant.levels,
        ]
    if meetings:
        parts.append(f"## How near they come\n\n{MEETINGS}\n\n{meetings}")
    parts += [_made(each) for each in (shown, *variants)]
    write_bytes(out, ("\n\n".join(parts) + "\n").encode())
    return out


def _headed(before: str, heading: str, title: str, file: str) -> str:
    """A heading, the words that the page has had below it `before`, and the film or picture that they are about."""
    words = before.partition(f"{heading}\n\n")[2].partition("![")[0].strip()
    return f"{heading}\n\n{words or TO_WRITE}\n\n![{title}]({file})"


def _claims(shown: Shown) -> str:
    return "\n".join(f"- {'' if holds else '**Does not hold:** '}{sentence}" for sentence, holds in shown.claims)


def write_index(entries: Sequence[Entry], out: Path) -> Path:
    """The list of all pages that are there, and the table of what levels cost."""
    write_bytes(out, f"{INDEX}{table_of_shots(entries, out.parent)}\n".encode())
    return out


def _speed(entry: Entry, dt: float) -> str:
    fraction = dt * FRAMES_PER_SECOND
    if entry.slow is None or fraction >= 1.0:
        return "real speed"
    return f"real speed, from {entry.slow[0]:g} s to {entry.slow[1]:g} s at {fraction:.2g} of it"


def _made(shown: Shown) -> str:
    """How and where the runs were made, in one sentence."""
    entry, made = shown.entry, shown.made
    settings = "".join(f" --set {shlex.quote(f'{name}={value}')}" for name, value in entry.settings.items())
    text = f"Made by `./run pdvol run {entry.file.relative_to(entry.file.parents[1])}{settings}`"
    if made:
        at, others = (commits(each) or "unknown" for each in (made, shown.made_directly or made))
        direct = f" (by the direct method: {others})" if others != at else ""
        text += f" at commit {at}{direct} on one core of {made['processor']}, {made['cores']} cores"
        text += f", load {made['load']:.1f}"
    return f"{text}. The model is {load_shot(entry.file, entry.settings).scene.model}."
