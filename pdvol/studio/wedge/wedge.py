"""A wedge: many variations of one scene on level 0, in one folder. See docs/wedge.md."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.runs.scene_file import Shot, check_names
from pdvol.store.files import read_json, write_json
from pdvol.store.reader import Run, open_run
from pdvol.studio.variations.folder import take_folder
from pdvol.studio.variations.jobs import Executor, Job, Outcome, run_jobs, stored_outcome
from pdvol.studio.variations.variation import Base, Variation, value_text
from pdvol.studio.variations.vary import MOST_VARIATIONS
from pdvol.studio.wedge.clusters import clusters
from pdvol.studio.wedge.scores import Score

WEDGE_FORMAT = 1  # of wedge.json: increased when an older pdvol cannot read it
WRITE_SHARE = 0.02  # of the time since wedge.json was last written that writing it may take


class Wedge:
    """A wedge's folder and what it holds. `taken` locks it for the time that it is worked on.

    Parameters
    ----------
    shot : from a scene file
    out : folder of the wedge
    scores : functions of a stored run, by their text

    Attributes
    ----------
    entries : list of dict
        As `variations` of wedge.json, in the order of their numbers.
    best : dict or None
        What a search has found: `number`, `score`, `of` (the text of the score), `runs`.
    """

    def __init__(self, shot: Shot, out: Path, scores: Mapping[str, Score] | None = None):
        self.shot, self.base, self.out, self.scores = shot, Base.of(shot), out.absolute(), dict(scores or {})
        self.entries: list[dict[str, Any]] = []
        self.best: dict[str, Any] | None = None
        self._vary: list[str] = []
        self._numbers: dict[str, int] = {}
        self._written = 0.0  # when, on time.monotonic()'s clock [s]
        self._writing = 0.0  # how long it took [s]

    @property
    def file(self) -> Path:
        """`wedge.json`."""
        return self.out / "wedge.json"

    def run_folder(self, name: str) -> Path:
        """The run folder of a variation of this name."""
        return self.out / "runs" / name

    @contextmanager
    def taken(self):  # type: ignore[no-untyped-def]  # a context manager of nothing
        """Make the folder, or go on with it; another process cannot meanwhile.

        Raises
        ------
        InputError
            It belongs to another scene, holds other files, cannot be made, or is in use.
        """
        description = {"scene": self.shot.description(), "steps": self.shot.scene.steps}
        held = take_folder(self.file, WEDGE_FORMAT, description, {"scene": str(self.base.scene), "variations": []})
        try:
            stored = read_json(self.file)
            self._vary, self.best = list(stored.get("vary", [])), stored.get("best")
            self.entries = [dict(entry) for entry in stored["variations"]]
            self._numbers = {entry["name"]: entry["number"] for entry in self.entries}
            yield
        finally:
            self.write()
            held.close()

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
        names = dict.fromkeys(name for variation in variations for name, _ in variation.changes)
        check_names(self.base.scene, names)  # a wrong name is an error now, a wrong value a failed variation
        new = [variation for variation in variations if variation.name not in self._numbers]
        if len(self.entries) + len(new) > MOST_VARIATIONS:
            raise InputError(f"{self.out} would hold more than {MOST_VARIATIONS} variations; choose another folder")
        for variation in new:
            self._numbers[variation.name] = len(self.entries)
            self.entries.append(new_entry(len(self.entries), variation))
        self._vary += [word for word in vary if word not in self._vary]
        return [self._numbers[variation.name] for variation in variations]

    def job(self, number: int) -> Job:
        """The run of a variation."""
        entry = self.entries[number]
        variation = Variation.from_json({"changes": entry["changes"], "method": "progressive"})
        words = [str(self.base.scene), *variation.words(self.base, "0:0")]
        return Job(entry["name"], words, self.run_folder(entry["name"]), range(1), variation.steps(self.base))

    def missing(self, numbers: Sequence[int]) -> list[Job]:
        """The jobs that are not stored. What is stored gets its state."""
        jobs = []
        for job in map(self.job, numbers):
            outcome = stored_outcome(job)
            if outcome is None:
                jobs.append(job)
            else:
                self._take(outcome)
        return jobs

    def run(
        self,
        numbers: Sequence[int],
        executor: Executor,
        report: Callable[[dict[str, Any], Outcome], None],
        deadline: float = math.inf,
    ) -> None:
        """Make the runs that are not stored, score all, and write wedge.json after each.

        Parameters
        ----------
        report : called with the entry and the outcome of each run that ended
        deadline : on `time.monotonic()`'s clock [s]: what runs then is stopped
        """
        waiting = [self.job(number) for number in reversed(dict.fromkeys(numbers))]
        self.write()
        for outcome in run_jobs(lambda running, left: waiting.pop() if waiting else None, executor, deadline):
            entry = self._take(outcome)
            if (time.monotonic() - self._written) * WRITE_SHARE > self._writing or not waiting:
                self.write()
            report(entry, outcome)

    def _take(self, outcome: Outcome) -> dict[str, Any]:
        entry = self.entries[self._numbers[outcome.job.name]]
        entry |= {"state": outcome.state, "reason": outcome.reason}
        if outcome.seconds:
            entry["seconds"] = outcome.seconds
        entry["scores"] = {**entry["scores"], **self._scores(entry)}
        return entry

    def _scores(self, entry: Mapping[str, Any]) -> dict[str, float | None]:
        """NaN, as None: a run that is not done has no score."""
        if entry["state"] != "done" or not self.scores:
            return dict.fromkeys(self.scores)
        return scored(self.run_folder(entry["name"]), self.scores)

    # ---- results

    def runs(self, entries: Sequence[Mapping[str, Any]]) -> list[Run | None]:
        """The stored run of each; None where it is not done."""
        return done_runs(self.out, entries)

    def write(self) -> None:
        """Write wedge.json."""
        begin = time.monotonic()
        write_json(
            self.file,
            {
                "format": WEDGE_FORMAT,
                "description": {"scene": self.shot.description(), "steps": self.shot.scene.steps},
                "scene": str(self.base.scene),
                "settings": {name: value_text(value) for name, value in self.base.settings},
                "steps": self.shot.scene.steps,
                "vary": self._vary,
                **({"best": self.best} if self.best else {}),
                "variations": self.entries,
            },
        )
        self._written = time.monotonic()
        self._writing = self._written - begin


def new_entry(number: int, variation: Variation) -> dict[str, Any]:
    """A variation that waits, as wedge.json lists it."""
    changes = {name: value_text(value) for name, value in variation.changes}
    return {
        "number": number,
        "name": variation.name,
        "changes": changes,
        "state": "waiting",
        "reason": "",
        "scores": {},
        "cluster": -1,
    }


def done_runs(folder: Path, entries: Sequence[Mapping[str, Any]]) -> list[Run | None]:
    """The stored run of each variation of a wedge's folder; None where it is not done."""
    return [open_run(folder / "runs" / e["name"]) if e["state"] == "done" else None for e in entries]


def group(entries: Sequence[dict[str, Any]], runs: Sequence[Run | None]) -> None:
    """Number the groups of variations that end alike: `cluster`, -1 where a run is not done."""
    for entry in entries:
        entry["cluster"] = -1
    found = [(entry, run) for entry, run in zip(entries, runs, strict=True) if run]
    if found:
        for (entry, _), cluster in zip(found, clusters([run for _, run in found]), strict=True):
            entry["cluster"] = int(cluster)


def scored(folder: Path, scores: Mapping[str, Score]) -> dict[str, float | None]:
    """Scores of a stored run, None where one cannot be said."""
    run = open_run(folder)
    values = {text: float(score(run)) for text, score in scores.items()}
    return {text: value if math.isfinite(value) else None for text, value in values.items()}


def ordered(entries: Sequence[Mapping[str, Any]], sort: str) -> list[dict[str, Any]]:
    """Variations in an order: by `number`, by `cluster` (within each by the first score), by a score (largest first)
    or by a parameter. What has no value comes last.

    Raises
    ------
    InputError
        Nothing is named so.
    """
    scores = list(dict.fromkeys(name for entry in entries for name in entry["scores"]))
    changes = list(dict.fromkeys(name for entry in entries for name in entry["changes"]))
    if sort not in ("number", "cluster", *scores, *changes):
        raise InputError(f"--sort {sort}: choose one of {', '.join(['number', 'cluster', *scores, *changes])}")

    def place(entry: Mapping[str, Any]) -> tuple:
        score = entry["scores"].get(scores[0] if sort == "cluster" and scores else sort)
        by_score = (score is None, -(score or 0.0), entry["number"])
        if sort == "number":
            return (entry["number"],)
        if sort == "cluster":
            return (entry["cluster"] < 0, entry["cluster"], *by_score)
        if sort in scores:
            return by_score
        text = entry["changes"].get(sort)
        try:
            return (text is None, 0, float(text or 0.0), "", entry["number"])
        except ValueError:
            return (False, 1, 0.0, text, entry["number"])

    return [dict(entry) for entry in sorted(entries, key=place)]


def read_wedge(folder: Path) -> dict[str, Any]:
    """`wedge.json` of a folder; InputError where there is none, or one of another format."""
    try:
        stored = read_json(folder / "wedge.json")
    except FileNotFoundError:
        raise InputError(f"{folder} holds no wedge; make one by: pdvol wedge SCENE.py -o {folder}") from None
    if stored.get("format") != WEDGE_FORMAT or not isinstance(stored.get("variations"), list):
        raise InputError(f"{folder / 'wedge.json'} has another format; use the pdvol that wrote it")
    return stored
