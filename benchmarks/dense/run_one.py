"""One run of benchmarks.dense in a process of its own, or one per rank: `run_one.py CODE CLOCK SECONDS FILE RUN STEPS
SETTINGS LEVEL` marches one level of a scene file into the run folder RUN, with the package of the folder CODE.

CLOCK is `cpu` or `wall`. The march stops between two steps after SECONDS of CPU time, and its finished steps stay.
SETTINGS are the scene's, as JSON. Beside the run RUN.json has `seconds`, those of each step by that clock, and `ticks`,
the milliseconds that a fixed loop took after each step. The exit code is 0 when all steps were done or the time was
over, and 1 otherwise, with the reason on standard error.
"""

import functools
import importlib
import json
import sys
import time
from pathlib import Path


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


STEPPERS = (("pdvol/integrate/stepper.py", "Stepper"), ("pdvol/solve/level_problem.py", "LevelProblem"))
"""File and class whose method `step` takes a step: of this code, and of 97e899e."""


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


def main(folder: str, clock: str, seconds: str, file: str, out: str, steps: str, settings: str, level: str) -> int:
    """Runs the scene; returns the exit code."""
    import pdvol.forms
    import pdvol.meshes
    from pdvol.runs.runner import run_scene

    try:
        from pdvol.runs.scene_file import load_shot
    except ModuleNotFoundError:  # where it is at 97e899e
        from pdvol.runs.shot import load_shot
    for module in (pdvol, pdvol.forms, pdvol.meshes):
        if not Path(str(module.__file__)).is_relative_to(folder):
            print(f"ImportError: {module.__name__} is {module.__file__}, which is not of {folder}", file=sys.stderr)
            return 1
    timer, code, taken = Timer(float(seconds)), 0, time_steps(folder, clock)
    try:
        shot = load_shot(file, json.loads(settings), int(steps))
        run_scene(shot, out, int(level), int(level), progress=lambda *_: timer)
    except TimeUp:
        pass
    except pdvol.PdvolError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        code = 1
    Path(out).with_suffix(".json").write_text(json.dumps({"seconds": taken, "ticks": timer.ticks}))
    return code


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
