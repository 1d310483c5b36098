"""One scene in a process of its own: `trial_one FILE NAME RUN SECONDS [SEED]` marches `scene(name=NAME)` of FILE
into the run folder RUN.

After SECONDS it stops between two steps. Beside the run it writes RUN.json: how it ended, peak memory [MB] and seconds.
"""

import json
import sys
import time
from pathlib import Path

from benchmarks.common.process import peak_memory
from pdvol.errors import ConvergenceError, InputError
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot


class TimeUp(Exception):
    """The time allowed is over."""


class Timer:
    """Ends the march once the time is over; used in place of a progress bar."""

    def __init__(self, until: float):
        self.until = until

    def step(self, record) -> None:
        """Called when a step has been stored."""
        if time.perf_counter() > self.until:
            raise TimeUp

    def lasts(self, record) -> None:
        """Called while a step lasts."""

    def close(self) -> None:
        """Nothing is left open."""


def main(file: str, name: str, out: str, seconds: str, seed: str = "") -> int:
    """Runs the scene; returns 0 when it came to its end or the time was over, 1 when pdvol gave up. Any other error is
    a traceback.
    """
    begin, timer = time.perf_counter(), Timer(time.perf_counter() + float(seconds))
    reason, kind = "", "done"
    try:
        shot = load_shot(file, {"name": name, **({"seed": int(seed)} if seed else {})})
        run_scene(shot, out, progress=lambda level, total, done: timer)
    except TimeUp:
        kind = "time"
    except (ConvergenceError, InputError) as error:
        kind, reason = type(error).__name__, str(error)
    noted = {
        "outcome": kind,
        "reason": reason,
        "wall_seconds": time.perf_counter() - begin,
        "peak_memory_mb": peak_memory(),
    }
    Path(out).with_suffix(".json").write_text(json.dumps(noted))
    return int(bool(reason))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
