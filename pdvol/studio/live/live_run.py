"""One run of a live session, as it is being written."""

import time
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.runs.stage_lines import SO_FAR
from pdvol.store.folder import holds_run
from pdvol.store.reader import Run, open_run
from pdvol.studio.live.channel import REMARK, Channel
from pdvol.studio.workers import Worker, last_line


class LiveRun:
    """A run folder that a worker fills. A take is one that a hand has directed.

    Attributes
    ----------
    number : from 1, in the order of their beginnings
    folder, log : of the run, and of what its command line prints
    values : the settings that it has
    branch : the run and the step that it goes on from; None for a run from the start
    note : a remark for people
    state : "waiting", "running", "done", "stopped" (another run took its place) or "failed"
    reason : one line, where it failed
    finest, refined : the finest level wanted, and the finest one that was ordered
    worker : what computes it now; None where nothing does
    kept : the folder that it is copied to
    hand : what directs it; None for a run that is no take
    played : whether the hand directs it now
    first_state : seconds from the change to its first stored state; None before
    """

    def __init__(
        self,
        number: int,
        folder: Path,
        values: dict[str, Any],
        requested: float,
        branch: "tuple[LiveRun, int] | None" = None,
        note: str = "",
        hand: Channel | None = None,
    ):
        self.number, self.folder, self.log = number, folder, folder.with_suffix(".log")
        self.values, self.branch, self.note, self.hand = values, branch, note, hand
        self.played = hand is not None
        self.state, self.reason = "waiting", ""
        self.finest = self.refined = 0
        self.worker: Worker | None = None
        self.kept: Path | None = None
        self.first_state: float | None = None
        self._requested = requested
        self._run: Run | None = None
        self._remark = ""
        self._stamp = 0

    @property
    def running(self) -> bool:
        """Whether a worker computes it."""
        return self.worker is not None

    @property
    def lasting(self) -> str:
        """What its command line says of a step, or a preparation, that takes long; empty where none does."""
        line = last_line(self.log) if self.running else ""
        return line if line.endswith(SO_FAR) else ""

    @property
    def remark(self) -> str:
        """What it has said last of a hand that it cannot follow."""
        if self.played and self.running:
            self._remark = last_line(self.log, REMARK) or self._remark
        return self._remark

    def look(self) -> bool:
        """Read what has been stored since; whether there is a state to show."""
        run = self.stored
        if run is None or run.levels[0].steps == 0:
            return False
        if self.first_state is None:
            self.first_state = time.monotonic() - self._requested
        return True

    @property
    def stored(self) -> Run | None:
        """The stored run; None before there is one."""
        try:
            stamp = (self.folder / "run.json").stat().st_mtime_ns
            if stamp != self._stamp and holds_run(self.folder):
                self._run, self._stamp = open_run(self.folder), stamp
        except (InputError, OSError):  # at its creation, or removed
            return self._run
        return self._run

    @property
    def steps(self) -> int:
        """Stored states of level 0."""
        return 0 if self._run is None else self._run.levels[0].steps

    @property
    def level_0_ended(self) -> bool:
        """Whether level 0 gets no further step."""
        total = 0 if self._run is None else self._run.info["steps"]
        return self.steps > total or not self.running

    def levels_with(self, step: int) -> int:
        """The number of coarsest levels that have a step."""
        levels = [] if self._run is None else list(self._run.levels)
        return next((i for i, level in enumerate(levels) if level.steps <= step), len(levels))
