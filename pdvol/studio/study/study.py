"""A study: many runs of one scene, their errors against a reference, and what they say. See docs/study.md."""

import os
import platform
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import cached_property
from itertools import count
from pathlib import Path
from typing import Any

from pdvol.errors import InputError, SimulationError
from pdvol.levels.scene_fields import scene_diagonal
from pdvol.runs.scene_file import Shot
from pdvol.stages import say, stage
from pdvol.store.files import read_json, write_json
from pdvol.store.reader import open_run
from pdvol.studio.study.axes import Axis, base_value
from pdvol.studio.study.conclusions import conclusions
from pdvol.studio.study.plan import LEVEL_SHARE, REFERENCE, Plan, Wanted, finest_level
from pdvol.studio.study.reference import ReferenceStates, cost
from pdvol.studio.wedge.jobs import Job, Outcome, run_jobs, take_folder
from pdvol.studio.wedge.variation import Base, Variation, number, value_text
from pdvol.studio.workers import Workers

STUDY_FORMAT = 2  # of study.json: increased when an older pdvol cannot read it
JITTER_SHARE = 1e-3  # of the smallest body's diagonal: how far apart jittered starts end in free flight
PAGE_TIME = 6.0  # seconds of the budget that are kept for errors and the page


class Study:
    """A study's folder, its plan and its results.

    Parameters
    ----------
    shot : from a scene file
    out : folder of the study
    chosen : from `chosen_axes`
    method : "progressive" or "direct"
    last : the finest level; chosen by the budget when None
    reference : the variation that the user wants
    budget : [s] of wall time
    jobs : runs at a time
    """

    def __init__(
        self,
        shot: Shot,
        out: Path,
        chosen: tuple[Sequence[Axis], bool],
        method: str,
        last: int | None,
        reference: Variation | None,
        budget: float,
        jobs: int,
    ):
        if last is not None and not 0 <= last < shot.scene.levels:
            raise InputError(f"level {last} does not exist; the scene has levels 0:{shot.scene.levels - 1}")
        self.shot, self.out, self.jobs, self.budget, (axes, alone) = shot, out, jobs, budget, chosen
        self.begin = time.monotonic()
        scene = shot.scene
        self.base = Base.of(shot)
        self.size = scene_diagonal(scene)
        values = {name: base_value(shot, name) for name in ("dt", "tolerance")} | {a.name: a.base for a in axes}
        speed = float(f"{JITTER_SHARE * self.size / self.base.duration:.6g}")
        self.plan = Plan(axes, alone, method, values, budget, speed, reference)
        self.asked_last = last
        self._runs: dict[Variation, dict] = {}
        self._measured: dict[tuple[Variation, int], dict] = {}
        self._reference_states: dict[Variation, ReferenceStates] = {}
        self._ended = False

    # ---- the folder

    @cached_property
    def file(self) -> Path:
        """`study.json`."""
        return self.out / "study.json"

    def folder(self, variation: Variation) -> Path:
        """The run folder of a variation."""
        return self.out / "runs" / variation.name

    def run(self, report: Callable[[str], None]) -> dict:
        """Make all runs that the budget allows, measure them, and write study.json.

        Parameters
        ----------
        report : called with a line of text about each run that ended

        Raises
        ------
        InputError
            The folder holds another study, or cannot be written.
        SimulationError
            The scene's own settings fail.
        """
        folder = take_folder(self.file, STUDY_FORMAT, self._description(), {"points": []})
        with closing(folder), closing(Workers(self.jobs, fresh=True)) as workers:
            deadline = self.begin + max(self.budget - PAGE_TIME, 1.0)
            outcomes = run_jobs(self._choose, workers, deadline)
            for number in count(1):
                with stage(f"simulating until run {number} of the study ends"):
                    outcome = next(outcomes, None)
                if outcome is None:
                    break
                with stage(f"measuring {outcome.job.name}"):
                    self._take(outcome)
                report(self._line(outcome))
            with stage("measuring the study's runs"):
                return self.write()

    def _description(self) -> dict:
        return {"scene": self.shot.description(), "steps": self.shot.scene.steps, "method": self.plan.method}

    # ---- runs

    def _choose(self, running: Sequence[Job], left: float) -> Job | None:
        """The next run that fits into the seconds left."""
        names = {job.name for job in running}
        for entry in self.plan.missing():
            if entry.variation.name in names:
                continue
            if entry.variation == self.plan.base or self.plan.seconds_of(entry.variation, entry.last) <= left:
                return self._job(entry)
            if entry.purpose == REFERENCE:
                self.plan.closed[entry.variation] = "the time left does not suffice"
        if not running and self.plan.combine(self._cost_and_error):
            return self._choose(running, left)
        return None

    def _job(self, entry: Wanted) -> Job:
        variation = entry.variation
        steps, levels = variation.steps(self.base), range(entry.last + 1)
        words = [str(self.base.scene), *variation.words(self.base, f"0:{entry.last}")]
        self._runs.setdefault(variation, {"purpose": entry.purpose})
        say(f"{variation.name} has begun, levels 0 to {entry.last}")
        return Job(variation.name, words, self.folder(variation), levels, steps)

    def _take(self, outcome: Outcome) -> None:
        """Keeps how a run ended."""
        variation = next(v for v in self._runs if v.name == outcome.job.name)
        entry = self._runs[variation]
        entry |= {"state": outcome.state, "reason": outcome.reason, "last": outcome.job.levels[-1]}
        entry |= {"load": outcome.load} if outcome.load else {}
        if outcome.state != "done":
            self.plan.closed[variation] = outcome.reason
            if variation == self.plan.base:
                raise SimulationError(f"the scene's own settings: {outcome.reason}")
            return
        last = outcome.job.levels[-1]
        self.plan.done[variation] = last
        run = open_run(outcome.job.out)
        self.plan.costs[variation] = [cost(run, [level])["cpu"] for level in range(last + 1)]
        if outcome.seconds:
            self.plan.observe(outcome.seconds, sum(self.plan.costs[variation]))
        if variation not in self.plan.jitters:
            for level in range(last + 1):
                self._point(variation, level)
        if variation == self.plan.base and self.plan.last is None:
            cost0 = self.plan.crowding * self.plan.costs[variation][0]
            finest = finest_level(self.shot.scene, run.levels[0].mesh, cost0, LEVEL_SHARE * self.plan.seconds)
            self.plan.last = finest if self.asked_last is None else self.asked_last

    def _line(self, outcome: Outcome) -> str:
        done, missing = len(self.plan.done), len(self.plan.missing())
        left = max(self.budget - (time.monotonic() - self.begin), 0.0)
        state = outcome.state if outcome.state == "done" else f"{outcome.state}: {outcome.reason}"
        return f"{done} runs done, {missing} to do, {left:.0f} s of the budget left  {outcome.job.name}: {state}"

    # ---- results

    def _states(self) -> ReferenceStates | None:
        """That of the reference; None as long as a finer reference is to come."""
        reference = self.plan.chosen_reference()
        if reference is None or self.plan.last is None or not (self.plan.settled or self._ended):
            return None
        if reference not in self._reference_states:
            self._reference_states[reference] = ReferenceStates(open_run(self.folder(reference)), self.plan.last)
        return self._reference_states[reference]

    def _point(self, variation: Variation, level: int) -> dict | None:
        """Cost and errors of a run's level; None without a reference."""
        states = self._states()
        if states is None:
            return None
        if (variation, level) not in self._measured:
            run = open_run(self.folder(variation))
            counted = [level] if variation.method == "direct" else range(level + 1)
            levels = f"{level}:{level}" if variation.method == "direct" else f"0:{level}"
            self._measured[variation, level] = {
                "run": variation.name,
                **variation.as_json(),
                "level": level,
                "label": variation.label(level),
                "words": variation.words(self.base, levels),
                "purpose": self._runs[variation]["purpose"],
                "cost": cost(run, counted),
                "errors": states.errors(run, level),
            }
        return self._measured[variation, level]

    def _cost_and_error(self, variation: Variation) -> tuple[float, float] | None:
        if self.plan.last is None or self.plan.done.get(variation, -1) < self.plan.last:
            return None
        if variation == self.plan.chosen_reference():
            return None
        point = self._point(variation, self.plan.last)
        return None if point is None else (point["cost"]["cpu"], point["errors"]["end"])

    def write(self) -> dict:
        """Measure what there is and write study.json; returns it."""
        plan = self.plan
        self._ended = True
        reference = plan.chosen_reference()
        jittered = set(plan.jitters)
        points = [
            point
            for variation, last in plan.done.items()
            if variation not in jittered
            for level in range(last + 1)
            if not (variation == reference and level == plan.last)
            and (point := self._point(variation, level)) is not None
        ]
        result: dict[str, Any] = {
            "format": STUDY_FORMAT,
            "description": self._description(),
            "scene": str(self.base.scene),
            "settings": {name: value_text(value) for name, value in self.base.settings},
            "method": plan.method,
            "duration": self.base.duration,
            "dt": self.base.dt,
            "size": self.size,
            "levels": self._levels(),
            "axes": [self._axis(axis) for axis in plan.axes],
            "budget": self.budget,
            "jobs": self.jobs,
            "seconds": time.monotonic() - self.begin,
            "machine": {"processor": processor(), "cores": os.cpu_count()},
            "runs": [{"run": v.name, **v.as_json(), **entry} for v, entry in self._runs.items()],
            "left_out": [entry.variation.label() for entry in plan.missing()],
            "points": points,
        }
        states = self._states()
        if states is not None and reference is not None:
            result |= conclusions(result, reference, states, plan, self.folder, self.shot.scene.levels)
            result["reference"]["point"] = self._point(reference, self.plan.last or 0)
        write_json(self.file, result)
        return read_json(self.file)

    def _levels(self) -> list[dict]:
        done = self.plan.done.get(self.plan.base, -1)
        if done < 0:
            return []
        run = open_run(self.folder(self.plan.base))
        return [{"level": level.index, "vertices": len(level.rest)} for level in run.levels[: done + 1]]

    def _axis(self, axis: Axis) -> dict:
        values = [axis.base, *axis.others]
        return {
            "name": axis.name,
            "base": value_text(axis.base),
            "values": [value_text(value) for value in values],
            "numbers": [number(value) for value in values],
        }


def processor() -> str:
    """The processor's name."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")
