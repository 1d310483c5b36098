"""One run of a row in a process of its own, or one per rank: `run_one.py JSON` marches a scene file into a run folder.

JSON has `code`, the folder whose package runs; `clock`, `cpu` or `wall`; `limit`, the CPU seconds after which the march
stops between two steps; `file`, `settings`, `steps` (null for the scene's own) and `levels` [first, last] of the
scene; and `out`, the run folder. Beside it RUN.json has `outcome` (`done`, `time` or the name of pdvol's error),
`reason`, `seconds` of each step by that clock, `ticks`, the milliseconds that a fixed loop took after each step,
`wall_seconds` and `peak_memory_mb`. The exit code is 1 where pdvol gave up. Other errors are a traceback.
"""

import functools
import importlib
import json
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2]))  # behind the package that runs, which may be an older one

from benchmarks.common.process import peak_memory

STEPPERS = (("pdvol/integrate/stepper.py", "Stepper"), ("pdvol/solve/level_problem.py", "LevelProblem"))
"""File and class whose method `step` takes a step: of this code, and of 97e899e."""


class TimeUp(Exception):
    """The time allowed is over."""


class Timer:
    """Ends the march once so much CPU time is used; used in place of a progress bar.

    After each step it times a fixed loop: cores of a shared host run at their best or at half of that, and change
    between the two within seconds.
    """

    def __init__(self, seconds: float):
        self.seconds, self.ticks = seconds, []

    def step(self, record) -> None:
        """Called when a step has been stored."""
        begin, total = time.process_time(), 0
        for i in range(30_000):
            total += i * i
        now = time.process_time()
        self.ticks.append(1e3 * (now - begin))
        if now > self.seconds:
            raise TimeUp

    def lasts(self, record) -> None:
        """Called while a step lasts."""

    def close(self) -> None:
        """Nothing is left open."""


def time_steps(folder: str, clock: str) -> list[float]:
    """A list that gets the seconds of each step that the package in `folder` takes from now on.

    The clock is read around a whole step: a system call, 0.6 to 1.6 us, for each of its hundred and more parts would
    add a tenth to the time of a small scene.
    """
    read, seconds = {"cpu": time.process_time, "wall": time.perf_counter}[clock], []
    for file, name in STEPPERS:
        # Importing the other code's file would find this repository's own, where that is installed.
        if not (Path(folder) / file).is_file():
            continue
        stepper = getattr(importlib.import_module(file.removesuffix(".py").replace("/", ".")), name)
        step = stepper.step

        @functools.wraps(step)
        def timed(*arguments, step=step, **named):
            begin = read()
            report = step(*arguments, **named)
            seconds.append(read() - begin)
            return report

        stepper.step = timed
    return seconds


def main(words: str) -> int:
    """Runs the scene; returns the exit code."""
    asked, begin = json.loads(words), time.perf_counter()
    from mpi4py import MPI

    import pdvol.forms
    import pdvol.meshes
    from pdvol.runs import runner

    try:
        from pdvol.runs.scene_file import load_shot
    except ModuleNotFoundError:  # where it is at 97e899e
        from pdvol.runs.shot import load_shot
    for module in (pdvol, pdvol.forms, pdvol.meshes):
        if not Path(str(module.__file__)).is_relative_to(asked["code"]):
            print(f"ImportError: {module.__name__} is {module.__file__}, not of {asked['code']}", file=sys.stderr)
            return 1
    timer, taken = Timer(asked["limit"]), time_steps(asked["code"], asked["clock"])
    outcome, reason = "done", ""
    try:
        shot = load_shot(asked["file"], asked["settings"], asked["steps"])
        watched = {"progress": lambda *_: timer}  # an argument of earlier commits
        how = {"how": runner.Execution(**watched)} if hasattr(runner, "Execution") else watched
        runner.run_scene(shot, asked["out"], *(asked["levels"] or (0, None)), **how)
    except TimeUp:
        outcome = "time"
    except pdvol.PdvolError as error:
        outcome, reason = type(error).__name__, str(error)
        print(f"{outcome}: {reason}", file=sys.stderr)
    noted = {"outcome": outcome, "reason": reason, "seconds": taken, "ticks": timer.ticks}
    noted |= {"wall_seconds": time.perf_counter() - begin, "peak_memory_mb": peak_memory()}
    if MPI.COMM_WORLD.rank == 0:
        Path(asked["out"]).with_suffix(".json").write_text(json.dumps(noted))
    return int(bool(reason))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
