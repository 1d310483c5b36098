"""One run of benchmarks.dense in a process of its own, or one per rank: `run_one.py CODE CLOCK SECONDS FILE RUN STEPS
SETTINGS LEVEL` marches one level of a scene file into the run folder RUN, with the package of the folder CODE.

CLOCK is `cpu` or `wall`: what the seconds of log.jsonl are. The march stops between two steps after SECONDS of CPU
time, and its finished steps stay. SETTINGS are the scene's, as JSON. Beside the run RUN.json has the milliseconds
that a fixed loop took after each step. The exit code is 0 when all steps were done or the time was over, and 1
otherwise, with the reason on standard error.
"""

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

    def close(self) -> None:
        """Nothing is left open."""


def main(folder: str, clock: str, seconds: str, file: str, out: str, steps: str, settings: str, level: str) -> int:
    """Runs the scene; returns the exit code."""
    if clock == "cpu":  # before pdvol is imported: its timers then read this process's user and system time
        time.perf_counter = time.process_time
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
    timer, code = Timer(float(seconds)), 0
    try:
        shot = load_shot(file, json.loads(settings), int(steps))
        run_scene(shot, out, int(level), int(level), progress=lambda *_: timer)
    except TimeUp:
        pass
    except pdvol.PdvolError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        code = 1
    Path(out).with_suffix(".json").write_text(json.dumps(timer.ticks))
    return code


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
