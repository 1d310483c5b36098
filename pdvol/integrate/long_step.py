"""Signs of a step that lasts: how far its solves are, so that a user sees what the step waits for."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from pdvol.potentials.potential import Positions
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.report import StepReport

SHOWN_AFTER = 2.0  # seconds after which a step shows how far it is: shorter ones end before they are read
SHOWN_EVERY = 0.5  # seconds between two signs: a display that changes faster is not read

Show = Callable[[dict[str, Any]], Any]
"""Is called with what a step's log record would have so far: step, newton_iterations, contacts, min_gap, seconds."""


class LongStep:
    """Watches the iterations of a level's steps, one step after the other.

    Parameters
    ----------
    show : called on all ranks, at most every `SHOWN_EVERY` seconds, once a step has lasted for `SHOWN_AFTER`
    """

    def __init__(self, potential: IncrementalPotential, show: Show):
        self._potential, self._show = potential, show
        self._report: StepReport | None = None
        self._began = self._next = 0.0

    def begin(self, report: StepReport) -> None:
        """A step begins, which adds up what it does in this report."""
        self._report, self._began = report, time.perf_counter()
        self._next = self._began + SHOWN_AFTER

    def iterated(self, x: Positions, iterations: int) -> None:
        """A solve has come to x after so many iterations, which the step's report does not have yet. Collective."""
        now = time.perf_counter()
        if self._report is None or not x.space.reduce(now >= self._next, MPI.LOR):
            return
        self._next = now + SHOWN_EVERY
        gap = self._potential.min_gap(x)
        self._show(
            {
                "step": self._report.step,
                "newton_iterations": self._report.newton_iterations + iterations,
                "contacts": sum(term.count(x) for term in self._potential.contacts),
                "min_gap": gap if np.isfinite(gap) else None,
                "seconds": {"total": now - self._began},
            }
        )
