"""A wedge: many variations of one scene on level 0, in one folder of numbered runs. See docs/wedge.md."""

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.runs.scene_file import Shot, check_names
from pdvol.store.files import read_json, require_no_link_out, write_json
from pdvol.store.reader import Run, open_run
from pdvol.studio.shown import wedge_run
from pdvol.studio.wedge.clusters import clusters
from pdvol.studio.wedge.jobs import Job, Outcome, run_jobs, stored_outcome, take_folder
from pdvol.studio.wedge.scored_body import at_level
from pdvol.studio.wedge.scores import Score
from pdvol.studio.wedge.variation import Base, Variation
from pdvol.studio.wedge.vary import MOST_VARIATIONS
from pdvol.studio.workers import Workers

WEDGE_FORMAT = 2  # of wedge.json: increased when an older pdvol cannot read it; 1 kept runs in runs/NAME
WRITE_EVERY = 1.0  # seconds between two states of wedge.json while runs end

Report = Callable[[dict[str, Any], Outcome], None]
"""Called with the entry and the outcome of each run that ended."""


class Wedge:
    """A wedge's folder and what it holds. `taken` locks it for the time that it is worked on.

    Parameters
    ----------
    out : folder of the wedge
    description : of the scene, as JSON; a folder has variations of one scene
    scores : functions of a stored run, by their text
    base : what its variations share; None where the scene was made in memory

    Attributes
    ----------
    entries : list of dict
        As `variations` of wedge.json, in the order of their numbers.
    best : dict or None
        What a search has found: `number`, `score`, `of` (the text of the score), `runs`.
    """

    def __init__(
        self, out: Path, description: dict, scores: Mapping[str, Score] | None = None, base: Base | None = None
    ):
        self.out, self.file, self.base, self.scores = out.absolute(), out.absolute() / "wedge.json", base, scores or {}
        self.entries: list[dict[str, Any]] = []
        self.best: dict[str, Any] | None = None
        self._description, self._vary, self._numbers = description, list[str](), dict[str, int]()

    @classmethod
    def of(cls, shot: Shot, out: Path, scores: Mapping[str, Score] | None = None) -> "Wedge":
        """Of a scene file; InputError where the shot was made in memory."""
        return cls(out, {"scene": shot.description(), "steps": shot.scene.steps}, scores, Base.of(shot))

    @contextmanager
    def taken(self):  # type: ignore[no-untyped-def]  # a context manager of nothing
        """Make the folder, or go on with it; another process cannot meanwhile.

        Raises
        ------
        InputError
            It belongs to another scene, holds other files, cannot be made, or is in use.
        """
        with closing(take_folder(self.file, WEDGE_FORMAT, self._description, {"variations": []})):
            stored = read_wedge(self.out)
            self._vary, self.best = list(stored.get("vary", [])), stored.get("best")
            self.entries = [dict(entry) for entry in stored["variations"]]
            self._numbers = {entry["name"]: entry["number"] for entry in self.entries}
            try:
                yield
            finally:
                self.write()

    def write(self) -> None:
        """Write wedge.json."""
        content = {
            "format": WEDGE_FORMAT,
            "description": self._description,
            "scene": str(self.base.scene) if self.base else "",
            "vary": self._vary,
            **({"best": self.best} if self.best else {}),
            "variations": self.entries,
        }
        write_json(self.file, content)

    # ---- variations and their runs

    def add(self, variations: Sequence[Variation], vary: Sequence[str] = ()) -> list[int]:
        """Their numbers. Those that the folder has already keep theirs.

        Parameters
        ----------
        vary : the words of the command line that they come from

        Raises
        ------
        InputError
            The scene has no such parameter, or there are too many variations.
        """
        if self.base is not None:  # a wrong name is an error now, a wrong value a failed variation
            check_names(
                self.base.scene, dict.fromkeys(name for variation in variations for name, _ in variation.changes)
            )
        new = [variation for variation in variations if variation.name not in self._numbers]
        if len(self.entries) + len(new) > MOST_VARIATIONS:
            raise InputError(f"{self.out} would hold more than {MOST_VARIATIONS} variations; choose another folder")
        for number, variation in enumerate(new, len(self.entries)):
            self._numbers[variation.name] = number
            entry = {"number": number, "name": variation.name, "changes": {}, "state": "waiting", "reason": ""}
            self.entries.append({**entry, "scores": {}, "cluster": -1})
        for variation in variations:  # the file's own may be from elsewhere
            self.entries[self._numbers[variation.name]]["changes"] = variation.as_json()["changes"]
        self._vary += [word for word in vary if word not in self._vary]
        return [self._numbers[variation.name] for variation in variations]

    def job(self, number: int) -> Job:
        """The run of a variation."""
        entry, words, steps = self.entries[number], list[str](), 0
        if self.base is not None:
            variation = Variation.from_json(entry)
            words, steps = [str(self.base.scene), *variation.words(self.base, "0:0")], variation.steps(self.base)
        return Job(entry["name"], words, wedge_run(self.out, number, entry["name"]), range(1), steps)

    def missing(self) -> list[Job]:
        """The jobs that are not stored. What is stored gets its state."""
        jobs = [self.job(entry["number"]) for entry in self.entries]
        stored = [(job, stored_outcome(job)) for job in jobs]
        self.take((outcome for _, outcome in stored if outcome), lambda *_: None)
        return [job for job, outcome in stored if outcome is None]

    def run(self, numbers: Sequence[int], workers: Workers, report: Report, deadline: float = math.inf) -> None:
        """Make the runs that are not stored, and `take` all.

        Parameters
        ----------
        deadline : on `time.monotonic()`'s clock [s]: what runs then is stopped
        """
        waiting = [self.job(number) for number in reversed(dict.fromkeys(numbers))]
        self.take(run_jobs(lambda running, left: waiting.pop() if waiting else None, workers, deadline), report)

    def take(self, outcomes: Iterable[Outcome], report: Report) -> None:
        """Keep how runs ended, as they end, with their scores. wedge.json has their numbers before the first begins."""
        self.write()
        written = time.monotonic()
        for outcome in outcomes:
            entry = self.entries[self._numbers[outcome.job.name]]
            entry |= {"state": outcome.state, "reason": outcome.reason}
            if outcome.seconds:
                entry["seconds"] = outcome.seconds
            entry["scores"] |= dict.fromkeys(self.scores)
            if outcome.state == "done" and self.scores:
                run = level_0(self.out, entry)
                values = {text: float(score(run)) for text, score in self.scores.items()}
                entry["scores"] |= {text: value for text, value in values.items() if math.isfinite(value)}
            if time.monotonic() - written > WRITE_EVERY:
                self.write()
                written = time.monotonic()
            report(entry, outcome)

    # ---- results

    def grouped(self, sort: str = "") -> list[dict[str, Any]]:
        """Number the groups of variations that end alike, `cluster`, -1 where a run is not done; all `ordered`."""
        for entry, label in zip(self.entries, clusters(stored_runs(self.out, self.entries)).tolist(), strict=True):
            entry["cluster"] = label
        return ordered(self.entries, sort)


def level_0(folder: Path, entry: Mapping[str, Any]) -> Run:
    """The stored run of a variation of a wedge's folder, without finer levels that it was given since."""
    return at_level(open_run(wedge_run(folder, entry["number"], entry["name"])), 0)


def stored_runs(folder: Path, entries: Sequence[Mapping[str, Any]]) -> list[Run | None]:
    """`level_0` of each variation; None where it is not done."""
    return [level_0(folder, entry) if entry["state"] == "done" else None for entry in entries]


def ordered(entries: Sequence[Mapping[str, Any]], sort: str = "") -> list[dict[str, Any]]:
    """Variations in an order: by `number`, by `cluster` (within each by the first score), by a score (largest first) or
    by a parameter; by the first score, or the number, where `sort` is empty. What has no value comes last.

    Raises
    ------
    InputError
        Nothing is named so.
    """
    scores = list(dict.fromkeys(name for entry in entries for name in entry["scores"]))
    names = ["number", "cluster", *scores, *dict.fromkeys(name for entry in entries for name in entry["changes"])]
    sort = sort or [*scores, "number"][0]
    if sort not in names:
        raise InputError(f"--sort {sort}: choose one of {', '.join(names)}")

    def worth(entry: Mapping[str, Any], name: str) -> tuple:
        score = entry["scores"].get(name)
        return score is None, -(score or 0.0)

    def place(entry: Mapping[str, Any]) -> tuple:
        if sort == "number":
            return ()
        if sort == "cluster":
            return entry["cluster"] < 0, entry["cluster"], *worth(entry, scores[0] if scores else "")
        if sort in scores:
            return worth(entry, sort)
        value = change(entry, sort)
        return value == "", isinstance(value, str), value

    return [dict(entry) for entry in sorted(entries, key=lambda entry: (*place(entry), entry["number"]))]


def change(entry: Mapping[str, Any], name: str) -> float | str:
    """The value of a parameter: a number, or text; empty where the variation does not change it."""
    text = entry["changes"].get(name, "")
    try:
        return float(text)
    except ValueError:
        return text


_ENTRY = {"number": int, "name": str, "changes": dict, "state": str, "reason": str, "scores": dict}
"""What a variation in wedge.json has, and of which kind."""


def read_wedge(folder: Path) -> dict[str, Any]:
    """`wedge.json` of a folder; InputError where there is none, or one of another format."""
    try:
        stored = read_json(folder / "wedge.json")
    except FileNotFoundError:
        raise InputError(f"{folder} holds no wedge; make one by: pdvol wedge SCENE.py -o {folder}") from None
    require_no_link_out(folder)
    entries = stored.get("variations")
    if stored.get("format") not in range(1, WEDGE_FORMAT + 1) or not isinstance(entries, list):
        raise InputError(f"{folder / 'wedge.json'} has another format; use the pdvol that wrote it")
    for number, entry in enumerate(entries):
        if not isinstance(entry, dict) or any(type(entry.get(key)) is not kind for key, kind in _ENTRY.items()):
            raise InputError(f"{folder / 'wedge.json'}: variation {number} is not as pdvol wedge wrote it")
    return stored
