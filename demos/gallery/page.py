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
BINDING = "How level 1 is bound to level 0"
TO_WRITE = "To be written: what to look at, and what was learned."
"""The words of a page that has none."""
MODEL = "bdf2, smoothed elements, drift feedback 0.05"
"""The model of scenes that name none. A page names another one."""
INDEX = f"""# Gallery

![all demos of the gallery](sheet.png)

Each page has a film of the levels beside each other, claims that are checked on the stored run, and a table:

- CPU seconds of one core, beside other jobs, and Newton iterations are means over the steps.
- Distances are root mean squares over the mass, from level 0 prolonged, the largest in any state; with
  `--method direct` each level is simulated alone.
- Intersections are counted by `pdvol verify`, which is independent of the solver.

The model is {MODEL}, unless the page names another one.
`./run python -m demos.gallery NAME` makes a page, and simulates first what is not stored; `{RUNS}/NAME.html` plays
the run. `--check` simulates the quick levels anew and says which numbers are older than the solver.

## What a preview saves

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
    beside : the run by the direct method, where film and picture have its levels, too
    """

    entry: Entry
    run: Run
    levels: str
    claims: Sequence[tuple[str, bool]]
    made: Mapping[str, Any]
    made_directly: Mapping[str, Any]
    beside: Run | None = None


def write_entry(shown: Shown, out: Path, variants: Sequence[Shown] = ()) -> Path:
    """The page of an entry, and of its variants in their order, beside its film."""
    entry, run = shown.entry, shown.run
    before = out.read_text(encoding="utf-8") if out.is_file() else ""
    parts = [
        _headed(before, f"# {entry.title}", entry.title, f"{entry.name}.webp"),
        f"*{run.info['steps']} steps of {run.dt:g} s, {_speed(entry, run.dt)}. [Picture]({entry.name}.png).*",
        _claims(shown),
        shown.levels,
    ]
    if entry.binding:
        parts.append(_headed(before, f"## {BINDING}", BINDING, f"{entry.name}_binding.png"))
    for variant in variants:
        title = variant.entry.title.rpartition(": ")[2]
        film = f"{variant.entry.name}.webp"
        parts += [_headed(before, f"## {title}", title, film), _claims(variant), variant.levels]
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
    return f"from {entry.slow[0]:g} to {entry.slow[1]:g} s at {fraction:.2g} of real speed"


def _made(shown: Shown) -> str:
    """How and where the runs were made, in one sentence."""
    entry, made = shown.entry, shown.made
    settings = "".join(f" --set {shlex.quote(f'{name}={value}')}" for name, value in entry.settings.items())
    text = f"Made by `./run pdvol run {entry.file.relative_to(entry.file.parents[1])}{settings}`"
    if made:
        at, others = (commits(each) or "unknown" for each in (made, shown.made_directly or made))
        direct = f" (by the direct method: {others})" if others != at else ""
        text += f" at {at}{direct} on {made['processor']}"
    model = load_shot(entry.file, entry.settings).scene.model
    return f"{text}." if model == MODEL else f"{text}. The model is {model}."
