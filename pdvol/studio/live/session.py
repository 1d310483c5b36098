"""The runs behind a live page, without the page: which one is computed, which one is shown, and what became of each.

A change of a value starts a new run of level 0 in a temporary folder, and ends the one before. When level 0 is done the
finer levels follow in the same folder. `tick` moves everything on and is called again and again by one thread. Any
thread may call the other methods, which return at once.
"""

import shutil
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.processes import idle_cores
from pdvol.store.copying import copy_run, require_new
from pdvol.studio.live.channel import Channel
from pdvol.studio.live.live_run import LiveRun
from pdvol.studio.wedge.variation import value_text
from pdvol.studio.workers import Workers, last_line

DEBOUNCE = 0.1  # seconds without a further change after which a new run begins
LONGEST_WAIT = 0.4  # seconds after the first of many changes when a run begins all the same
POOL_SIZE = 3  # processes: one runs level 0, one refines, one is spare
MOST_RUNS = 6  # in the temporary folder; older ones are removed
BAD_INPUT = 2  # exit code of `pdvol` for input that no run can begin with
STOPPED_BY_SIGNAL = 130  # exit code of `pdvol` after an interruption: the end of a take


class Session:
    """Runs of one scene.

    Parameters
    ----------
    scene : the scene file
    settings : values by name that every run has, until `change` replaces them
    folder : for the runs; the caller removes it
    keep_in : where kept runs go
    finest : the finest level to refine to
    steps : of the shot; the scene's own when None
    wavefront : whether finer levels run side by side

    Attributes
    ----------
    current : the latest run; None before the first
    shown : the latest run that has a state to show; None before there is one
    paused : whether the computation is held
    """

    def __init__(
        self,
        scene: Path,
        settings: Mapping[str, Any],
        folder: Path,
        keep_in: Path,
        finest: int = 0,
        steps: int | None = None,
        wavefront: bool = False,
    ):
        self.scene, self.folder, self.keep_in = scene, folder, keep_in
        self.finest, self.steps, self.wavefront = finest, steps, wavefront
        self.values = dict(settings)
        self.current: LiveRun | None = None
        self.shown: LiveRun | None = None
        self.paused = False
        self._runs: list[LiveRun] = []
        self._number = 0
        self._workers = Workers(ahead=POOL_SIZE)
        self._lock = threading.RLock()
        self._requested: tuple[float, float] | None = None  # first and last change that no run has yet
        self._wait = 0.0
        self._branch: tuple[LiveRun, int] | None = None
        self._by_hand = False
        self._goal: int | None = None  # a paused run goes on until this step is stored

    def start(self) -> None:
        """Begin a run with the present values, at the next `tick`."""
        self.change({}, 0.0)

    def change(self, values: Mapping[str, Any], wait: float = DEBOUNCE) -> None:
        """Begin a new run with these values once none has changed for `wait` seconds."""
        with self._lock:
            self.values |= values
            now = time.monotonic()
            self._requested = (self._requested[0] if self._requested else now, now)
            self._wait, self._branch, self._by_hand = wait, None, False

    def branch(self, step: int, by_hand: bool = False) -> None:
        """Begin a new run with the present values from a stored step of the shown one, or a take."""
        with self._lock:
            if self.shown is not None or by_hand:
                self.start()
                self._by_hand = by_hand
                self._branch = (self.shown, step) if self.shown is not None and (step or not by_hand) else None

    def end_take(self) -> None:
        """Let go, and end the take that is played. Finer levels follow."""
        with self._lock:
            if self.playing is not None and self.playing.hand is not None and self.playing.worker is not None:
                self.playing.hand.hold([], {})
                self.playing.worker.interrupt()

    @property
    def playing(self) -> LiveRun | None:
        """The take that a hand directs now."""
        return self.current if self.current is not None and self.current.played and self.current.running else None

    @property
    def takes(self) -> list[LiveRun]:
        """The takes so far; they stay until the end of the session."""
        return [run for run in self._runs if run.hand is not None]

    def show(self, number: int) -> None:
        """Show a take; InputError where there is none of this number."""
        with self._lock:
            self.shown = self._take(number)

    def refine(self, number: int) -> None:
        """Show a take and compute its finer levels; errors as of `show`, and while a take is played."""
        with self._lock:
            if self.playing is not None:
                raise InputError("a take is played; end it before another one is refined")
            run = self.shown = self._take(number)
            if run.running:
                return
            if self.current is not None:
                self._give_up(self.current)
            self.current, run.finest, run.refined = run, self.finest, 0
            self._refine(run)

    def _take(self, number: int) -> LiveRun:
        found = [run for run in self.takes if run.number == number and run.steps]
        if not found:
            raise InputError(f"there is no take {number}")
        return found[0]

    def pause(self) -> None:
        """Hold the computation."""
        with self._lock:
            self.paused, self._goal = True, None
            self._hold(True)

    def resume(self) -> None:
        """Go on with the computation."""
        with self._lock:
            self.paused, self._goal = False, None
            self._hold(False)

    def go_to(self, step: int) -> None:
        """Let a paused run go on until this step is stored."""
        with self._lock:
            if self.paused and self.current is not None and self.current.running:
                self._goal = step
                self._hold(False)

    def keep(self, name: str) -> Path:
        """Copy the shown run to a folder of this name, where finer levels and further steps follow as they are made.

        Raises
        ------
        InputError
            The name is no folder's name, is taken, or there is nothing to keep.
        """
        with self._lock:
            name = name.strip()
            if self.shown is None:
                raise InputError("there is no run to keep yet")
            if not name or Path(name).name != name or name.startswith("."):
                raise InputError(f"{name!r} is no name of a folder: write letters, digits and - without /")
            target = self.keep_in / name
            require_new(target)
            copy_run(self.shown.folder, target)
            self.shown.kept = target
            return target

    def tick(self) -> None:
        """Look at the processes, start what is due, and follow the stored states."""
        with self._lock:
            self._workers.look()
            now = time.monotonic()
            if self._requested and (
                now - self._requested[1] >= self._wait or now - self._requested[0] >= LONGEST_WAIT + self._wait
            ):
                requested, self._requested = self._requested[1], None
                branch, self._branch = self._branch, None
                self._begin(requested, branch, by_hand=self._by_hand)
            run = self.current
            if run is None:
                return
            if run.first_state is None and run.look():
                self.shown = run
            if self._goal is not None and run.steps > self._goal:
                self._goal = None
                self._hold(True)
            if run.worker is not None:
                code = run.worker.poll()
                if code is not None:
                    self._ended(run, code)

    def close(self) -> None:
        """End all processes; what has been kept has their last whole states."""
        with self._lock:
            self._requested = None
            if self.current is not None:
                self._update_kept(self.current)
            self._workers.close()

    # ---- the life of a run

    def _begin(
        self, requested: float, branch: tuple[LiveRun, int] | None, note: str = "", by_hand: bool = False
    ) -> None:
        if self.current is not None:
            self._give_up(self.current)
        self._number += 1
        folder = self.folder / f"{self._number:04d}"
        hand = Channel(folder.with_suffix(".hand")) if by_hand else None
        run = LiveRun(self._number, folder, dict(self.values), requested, branch, note, hand)
        self.current = run
        self._runs.append(run)
        more = [] if branch is None else ["--branch", branch[0].folder, "--at", branch[1]]
        run.finest = self.finest if branch is None else min(self.finest, branch[0].levels_with(branch[1]) - 1)
        if branch is not None:
            run.refined = run.finest
            if run.finest < self.finest:
                run.note = f"level {run.finest + 1} had not reached step {branch[1]}: this run is not refined that far"
        if hand is not None:
            run.finest, run.refined, run.note, self.paused = self.finest, 0, note, False
            reached = branch is None or branch[0].levels_with(branch[1]) > 1
            follows = self.finest > 0 and reached and idle_cores() > 1  # level 1, in a process of its own
            more += ["--hand-from", hand.file, *(["--wavefront"] if follows else [])]
            self._carry_out(run, ["--levels", f"0:{int(follows)}", *more])
        else:
            self._carry_out(run, ["--levels", f"0:{run.refined}", *more])
        self._remove_old()

    def _carry_out(self, run: LiveRun, words: list[Any]) -> None:
        steps = [] if self.steps is None or run.hand is not None else ["--steps", self.steps]
        settings = [word for name, value in run.values.items() for word in ("--set", f"{name}={value_text(value)}")]
        options = ["--out", run.folder, "--no-picture", "--no-xdmf", "--ranks", 1]
        self._order(run, ["run", self.scene, *options, *steps, *words, *settings])

    def _order(self, run: LiveRun, words: list[Any]) -> None:
        run.worker = self._workers.start([str(word) for word in words], run.log)
        run.state = "running"
        if self.paused:
            self._hold(True)

    def _ended(self, run: LiveRun, code: int) -> None:
        """One command line of a run has ended."""
        if run.worker is not None:
            self._workers.give_up(run.worker)
        run.worker = None
        run.look()
        if code == BAD_INPUT and run.branch is not None and run.steps == 0:
            note = f"it starts from step 0, because {last_line(run.log)}"
            self._begin(time.monotonic(), None, note, run.hand is not None)
            return
        ended, run.played = run.played and code == STOPPED_BY_SIGNAL, False
        if ended and run.steps < 2:
            run.state = "stopped"
        elif code != 0 and not ended:
            run.state, run.reason = "failed", last_line(run.log) or f"its process ended with status {code}"
        elif run.refined >= run.finest:
            run.state = "done"
        else:
            self._refine(run)
        self._update_kept(run)

    def _refine(self, run: LiveRun) -> None:
        """Order the finer levels of a run whose level 0 has ended."""
        levels, run.refined = f"{run.refined + 1}:{run.finest}", run.finest
        wavefront = "--wavefront" if self.wavefront else "--no-wavefront"  # the first refined step comes sooner
        if run.hand is None:
            self._carry_out(run, ["--levels", levels, "--resume", wavefront])
        elif run.finest:
            self._order(run, ["refine", run.folder, "--to", run.finest, "--no-picture", wavefront])

    def _give_up(self, run: LiveRun) -> None:
        """End what is computed of a run; its states stay."""
        if run.worker is not None:
            self._workers.give_up(run.worker)
            run.worker, run.state, run.played = None, "stopped", False
        self._update_kept(run)

    def _update_kept(self, run: LiveRun) -> None:
        if run.kept is not None:
            copy_run(run.folder, run.kept)

    def _hold(self, held: bool) -> None:
        if self.current is not None and self.current.worker is not None:
            if held:
                self.current.worker.pause()
            else:
                self.current.worker.resume()

    def _remove_old(self) -> None:
        kept = (self.current, self.shown)
        for run in [run for run in self._runs if run.hand is None][:-MOST_RUNS]:
            if run in kept:
                continue
            self._runs.remove(run)
            shutil.rmtree(run.folder, ignore_errors=True)
            run.log.unlink(missing_ok=True)
