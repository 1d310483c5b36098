"""One scene in a process of its own, or one per rank: `run_one NAME PEERS RUN [STEPS]` marches it into the run
folder RUN.

Beside the run it writes RUN.json: wall-clock seconds of each step with its storage, and each rank's peak memory.
"""

import json
import sys
import time
from pathlib import Path

from mpi4py import MPI

import pdvol
from benchmarks.common.process import peak_memory
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot

SCENE_FILE = Path(__file__).with_name("scenes.py")


class Clock:
    """Seconds from one stored step to the next [s], of one level; used in place of a progress bar."""

    def __init__(self):
        self.seconds, self._last = [], time.perf_counter()

    def step(self, record) -> None:
        """Called when a step has been stored."""
        now = time.perf_counter()
        self.seconds.append(now - self._last)
        self._last = now

    def lasts(self, record) -> None:
        """Called while a step lasts."""

    def close(self) -> None:
        """Nothing is left open."""


def main(name: str, peers: str, out: str, steps: str = "") -> int:
    """Runs the scene; returns 0, or 1 with the reason on standard error when pdvol gives up."""
    comm, clocks, begin = MPI.COMM_WORLD, {}, time.perf_counter()
    try:
        shot = load_shot(SCENE_FILE, {"name": name, "peers": peers}, int(steps) if steps else None)
        run_scene(shot, out, progress=lambda level, total, done: clocks.setdefault(level, Clock()))
        reason = ""
    except pdvol.PdvolError as error:  # raised on every rank
        reason = str(error)
    memory = comm.gather(peak_memory())
    if comm.rank == 0:
        noted = {
            "wall_seconds": time.perf_counter() - begin,
            "stored": {level: clock.seconds for level, clock in clocks.items()},
            "peak_memory_mb": memory,
            "reason": reason,
        }
        Path(out).with_suffix(".json").write_text(json.dumps(noted))
        if reason:
            print(f"PdvolError: {reason}", file=sys.stderr)
    return int(bool(reason))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
