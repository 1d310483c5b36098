"""One rank of `benchmarks.ranks --shares`: `pdvol run` with a stopwatch that leaves out what is spent in MPI.

`one_rank.py FILE WORD ...` calls `pdvol WORD ...` and writes FILE: a list with an entry a step, in which each rank has
a row of COLUMNS. `messages.c` has to be preloaded.
"""

import ctypes
import json
import sys
import time
from pathlib import Path
from types import SimpleNamespace

from benchmarks.common import process
from pdvol import cli
from pdvol.solve import report
from pdvol.solve.linear import messages

COUNTERS = ("waited", "bytes", "calls")
COLUMNS = (*report.PARTS, "other", *COUNTERS, "gradients", "memory")
"""CPU seconds of each part of a step, CPU seconds in MPI, bytes sent, calls of MPI, iterations of conjugate gradients,
and the largest memory so far [MB].
"""


def main(file: Path, words: list[str]) -> None:
    """Runs pdvol; rank 0 writes the file."""
    preloaded, values = ctypes.CDLL(None), (ctypes.c_double * 3)()
    messages.library = lambda: preloaded  # compiled loops call the preloaded functions, too
    steps: list[list[list[float]]] = []

    def counted() -> list[float]:
        preloaded.in_messages(values)
        return list(values)

    def working() -> float:
        """CPU time [s] of this thread outside MPI."""
        return time.thread_time() - counted()[0]

    report.time = SimpleNamespace(perf_counter=working, process_time=working)
    measure, last = report.StepReport.measure, counted()

    def noted(self, watch, space) -> None:
        nonlocal last
        sent = [now - before for now, before in zip(counted(), last, strict=True)]
        measure(self, watch, space)
        seconds = [self.seconds[part] for part in (*report.PARTS, "other")]
        rows = space.comm.gather([*seconds, *sent, self.linear_iterations, process.peak_memory()])
        if rows is not None:
            steps.append(rows)
        last = counted()

    report.StepReport.measure = noted
    try:
        cli.main(argv=words)
    finally:
        if steps:
            file.write_text(json.dumps(steps))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
