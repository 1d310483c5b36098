"""What a player shows: levels of runs beside each other, or the variations of a wedge folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, inf
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.store.files import read_json, require_no_link_out
from pdvol.store.reader import Run, RunLevel, open_run
from pdvol.store.render_meshes import StoredRender
from pdvol.studio.play.details import Detail
from pdvol.studio.play.fields import PointField
from pdvol.studio.play.motion import Skin
from pdvol.studio.shown import wedge_run

WEDGE = "wedge.json"
"""The file that a wedge folder is known by."""
MOST_VERTEX_STATES = 12_000_000  # drawn vertices times states in a file: about 50 MB, and 100 MB in a browser's memory


@dataclass(frozen=True, eq=False)
class Pane:
    """One picture of the player.

    Attributes
    ----------
    title : str
    run : Run or None
        None where there is only a title and a note.
    level : int
    states : int
        How many of the level's states are played, from the first one on.
    lines : sequence of str
        Below the title: parameters, scores.
    note : str
        Why there is nothing to see, or not all of it.
    fields : mapping
        Colours of the level's vertices, by a name in `fields.FIELDS`.
    every : int
        One state in this many is in the file, and the last one.
    detailed : bool
        Whether render meshes of bodies are in the file.
    """

    title: str
    run: Run | None = None
    level: int = 0
    states: int = 0
    lines: Sequence[str] = ()
    note: str = ""
    fields: Mapping[str, PointField] = field(default_factory=dict)
    every: int = 1
    detailed: bool = True

    @property
    def details(self) -> tuple[StoredRender, ...]:
        """The render meshes that are drawn."""
        return self.run.render_meshes if self.run is not None and self.detailed else ()

    @property
    def stored(self) -> RunLevel:
        """The level; only of panes that have a run."""
        if self.run is None:
            raise ValueError(f"the pane {self.title!r} has no run")
        return self.run.levels[self.level]

    @property
    def steps(self) -> list[int]:
        """The states in the file."""
        return sorted({*range(0, self.states, self.every), *range(self.states)[-1:]})


def panes_of_run(run: Run, levels: Sequence[int] | None = None, named: bool = False) -> list[Pane]:
    """A pane for each level; `named` puts the run's name before the level's number.

    Parameters
    ----------
    levels : all that hold a state when None

    Raises
    ------
    InputError
        A level does not exist or has no state.
    """
    chosen = [level.index for level in run.levels if level.steps] if levels is None else list(levels)
    if not chosen:
        raise InputError(f"{run.path} has no stored state to play")
    panes = []
    for number in chosen:
        if not 0 <= number < len(run.levels):
            raise InputError(f"{run.path} has levels 0 to {len(run.levels) - 1}, not {number}")
        states = run.levels[number].steps
        if not states:
            raise InputError(f"{run.path}: level {number} has no stored state to play")
        name = f"{run.path.resolve().name}, " if named else ""
        vertices = f"{len(run.levels[number].rest):,} vertices"
        panes.append(Pane(f"{name}level {number}", run, number, states, (vertices,), _unfinished(run, number, states)))
    return panes


def thinned(panes: Sequence[Pane], every: int | None = None) -> list[Pane]:
    """The same panes with one state in `every`, which each names; as few are left out as a file of
    `MOST_VERTEX_STATES` asks for when None.
    """
    if every is None:
        count = sum(pane.states * drawn_vertices(pane) for pane in panes if pane.run is not None)
        every = max(1, ceil(count / MOST_VERTEX_STATES))
    remark = (f"one state in {every}",) if every > 1 else ()
    return [replace(pane, every=every, lines=(*pane.lines, *remark)) if pane.run else pane for pane in panes]


def drawn_vertices(pane: Pane) -> int:
    """The number of vertices in a state of a pane, those of render meshes included."""
    return len(Skin(pane.stored).vertices) + sum(len(Detail(mesh).vertices) for mesh in pane.details)


def panes_of_wedge(folder: Path, levels: Sequence[int] | None = None) -> list[Pane]:
    """A pane for each variation of a wedge folder, on level 0 if no levels are named: the best first, by the first
    score. Those that failed, or that cannot be read, are panes with their reason.

    Raises
    ------
    InputError
        `wedge.json` is no list of variations.
    """
    entries = read_json(folder / WEDGE).get("variations")
    require_no_link_out(folder)
    if not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{folder / WEDGE} has no list of variations: it is not as pdvol wedge wrote it")
    first = next((name for entry in entries for name in _mapping(entry, "scores")), "")
    values = [_mapping(entry, "scores").get(first) for entry in entries]
    worth = [value if isinstance(value, int | float) else -inf for value in values]
    order = sorted(range(len(entries)), key=lambda place: -worth[place])
    return [pane for place in order for pane in _panes_of_variation(folder, place, entries[place], levels)]


def _panes_of_variation(folder: Path, place: int, entry: Mapping[str, Any], levels: Sequence[int] | None) -> list[Pane]:
    name = str(entry.get("name", place))
    changes, scores = _mapping(entry, "changes"), _mapping(entry, "scores")
    lines = [" ".join(f"{key}={value}" for key, value in changes.items())]
    lines += [f"{key} {value:.3g}" for key, value in scores.items() if isinstance(value, int | float)]
    lines = [line for line in lines if line]
    title = str(entry.get("number", place)) if changes else name
    reason = str(entry.get("reason") or "")
    try:
        panes = panes_of_run(
            open_run(wedge_run(folder, entry.get("number", place), name)), [0] if levels is None else levels
        )
    except InputError as error:
        return [Pane(title, lines=lines, note=reason or _short(error, entry.get("state")))]
    titles = [f"{title}, {pane.title}" for pane in panes] if len(panes) > 1 else [title]
    return [
        replace(pane, title=own, lines=lines, note=reason or pane.note) for pane, own in zip(panes, titles, strict=True)
    ]


def _mapping(entry: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = entry.get(key)
    return value if isinstance(value, dict) else {}


def _short(error: InputError, state: Any) -> str:
    return "not simulated yet" if state == "waiting" else str(error)


def _unfinished(run: Run, level: int, states: int) -> str:
    """A remark on a level whose last state is not the run's last one."""
    wanted = run.info.get("steps")
    if not isinstance(wanted, int) or states > wanted:
        return ""
    return f"stored up to {(states - 1) * run.dt:.3g} s of {wanted * run.dt:.3g} s"
