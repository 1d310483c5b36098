"""The Markdown page of an entry, and the gallery's index."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from demos.gallery.entries import Entry
from demos.gallery.film import FRAMES_PER_SECOND
from demos.gallery.shots import table_of_shots
from pdvol.runs.scene_file import load_shot
from pdvol.store.files import write_bytes
from pdvol.store.reader import Run

RUNS = "runs/gallery"  # folder of the gallery's runs
MEETINGS = (
    "At the end. Gaps are distances from vertices of the one surface to the other surface, negative inside it. Embedded"
    " means that level 1 only follows level 0, by the same interpolation."
)
"""What stands above the table of how near bodies come."""
COSTS = (
    "Means over all steps of a level, CPU time on one core, beside other jobs."
    " A level solves what the direct simulation of it solves: its own forces,\ncontact and friction, from another"
    " prediction. `./run python -m demos.gallery --check` says which of these numbers are older than the solver."
)
"""What stands above the table of costs."""


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
    parts = [
        f"# {entry.title}",
        entry.about.strip(),
        _film(entry, entry.title),
        f"*{run.info['steps'] * run.dt:.3g} s, {run.info['steps']} steps of {run.dt:g} s; {_speed(entry, run.dt)}."
        f" As a picture: [{entry.name}.png]({entry.name}.png).*",
        "## What it shows\n\n" + _claims(shown),
        f"## The levels\n\n{shown.levels}",
        _binding(entry),
        *(
            f"## {film.title}\n\n{film.about.strip()}\n\n![{film.title}]({entry.name}_{film.name}.webp)"
            for film in entry.further
        ),
        *(part for variant in variants for part in _variant(variant)),
        f"## How near they come\n\n{MEETINGS}\n\n{meetings}" if meetings else "",
        "\n\n".join(_made(each) for each in (shown, *variants)),
    ]
    write_bytes(out, ("\n\n".join(part for part in parts if part) + "\n").encode())
    return out


def _variant(shown: Shown) -> list[str]:
    """The part of the page that a variant has."""
    title = shown.entry.title.rpartition(": ")[2]
    return [
        f"## {title}",
        shown.entry.about.strip(),
        _film(shown.entry, title),
        _claims(shown),
        shown.levels,
    ]


def _film(entry: Entry, title: str) -> str:
    return f"![{title}: the levels beside each other]({entry.name}.webp)"


def _claims(shown: Shown) -> str:
    return "\n".join(f"- {'' if holds else '**Does not hold:** '}{sentence}" for sentence, holds in shown.claims)


def write_index(entries: Sequence[Entry], out: Path) -> Path:
    """The list of all pages that are there, and the table of what levels cost."""
    there = [entry for entry in entries if (out.parent / f"{entry.name}.md").is_file()]
    lines = [f"- [{entry.title}]({entry.name}.md): `demos/{entry.name}.py`" for entry in there]
    text = (
        "# Gallery\n\n![all demos of the gallery](sheet.png)\n\n"
        + "\n".join(lines)
        + "\n\nEach page, its film and its table are made from a stored run by `./run python -m demos.gallery NAME`,"
        f" which simulates first what is not stored. `{RUNS}/NAME.html` plays it.\nA demo's claim is checked on the"
        " stored run when its page is made, and on small levels by the tests.\n\nDistances are root mean squares over"
        " the mass, from the coarser level prolonged to the finer one. With `--method direct` each level is simulated\n"
        "on its own. Intersections are counted by `pdvol verify`, which is independent of the solver.\n\n"
        f"## What a preview saves\n\n{COSTS}\n\n{table_of_shots(entries, out.parent)}\n"
    )
    write_bytes(out, text.encode())
    return out


def _speed(entry: Entry, dt: float) -> str:
    if entry.slow is None or dt * FRAMES_PER_SECOND >= 1.0:
        return "real speed"
    fraction = dt * FRAMES_PER_SECOND
    return f"real speed, from {entry.slow[0]:g} s to {entry.slow[1]:g} s at {fraction:.2g} of it"


def _binding(entry: Entry) -> str:
    if not entry.binding:
        return ""
    return (
        "## How level 1 is bound to level 0\n\nLeft, the vertices of level 1 as dots on the mesh of level 0; those of"
        " one colour are bound to the same cell. Right, the weights of one vertex of level 0, the warmer the larger."
        f"\n\n![How level 1 is bound to level 0]({entry.name}_binding.png)"
    )


def _made(shown: Shown) -> str:
    """How and where the runs were made, in one sentence."""
    entry, made = shown.entry, shown.made
    settings = "".join(f" --set {shlex.quote(f'{name}={value}')}" for name, value in entry.settings.items())
    finest = "" if entry.finest is None else f" --levels 0:{shown.run.levels[-1].index}"
    command = f"./run pdvol run {entry.file.relative_to(entry.file.parents[1])}{settings}{finest}"
    model = f" The model is {load_shot(entry.file, entry.settings).scene.model}."
    if not made:
        return f"Made by `{command}`.{model}"
    commits, others = _commits(made), _commits(shown.made_directly)
    direct = f" (by the direct method: {others})" if others not in ("", commits) else ""
    return (
        f"Made by `{command}` at commit {commits}{direct} on one core of {made['processor']},"
        f" {made['cores']} cores, load {made['load']:.1f}.{model}"
    )


def _commits(made: Mapping[str, Any]) -> str:
    return ", ".join(commit[:7] for commit in made.get("commits", ()) if commit) or ("unknown" if made else "")
