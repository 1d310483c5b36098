"""What one finished step of one level reports."""

import resource
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from pdvol.solve.minimisation import NewtonReport
from pdvol.solve.remedies import no_remedies


@dataclass
class StepReport:
    """One finished step of one level (design, section 4, `log.jsonl`), with its positions.

    Attributes
    ----------
    positions : (n, d) [m], in the input's vertex order, on every rank
    friction_iterations : solves with friction lagged anew, over all parts of a step that was cut
    friction_residual : change of the friction forces at the end if they were lagged anew there, relative to them
    kappa : stiffness of the barrier: [Pa], or [N] per contact where its law is not the convergent one
    reached : share of the step's scripted motion that was carried out
    behind : [s] how far scripted motions are behind the time at the step's end, because contact stops them
    cuts : how often the step was halved
    solver_memory : the linear solver's state for the next step (`LinearSolver.memory`)
    remedies : how often each remedy was taken (`solve/remedies.py`)
    """

    level: int
    step: int
    time: float
    positions: np.ndarray
    newton_iterations: int = 0
    linear_iterations: int = 0
    hessians: int = 0
    backtracks: int = 0
    step_cap: float = 1.0
    contacts: int = 0
    min_gap: float | None = None
    friction_iterations: int = 0
    friction_residual: float | None = None
    kappa: float | None = None
    energy: dict[str, float] = field(default_factory=dict)
    gradient_norm: float = 0.0
    reason: str = ""
    linear_solver: str = ""
    solver_memory: dict = field(default_factory=dict)
    cuts: int = 0
    reached: float = 1.0
    behind: float = 0.0
    remedies: dict[str, int] = field(default_factory=no_remedies)
    seconds: dict[str, float] = field(default_factory=dict)
    peak_memory_mb: float = 0.0

    def add(self, solved: NewtonReport) -> None:
        """Adds the counts of one Newton solve."""
        self.newton_iterations += solved.iterations
        self.linear_iterations += solved.linear_iterations
        self.hessians += solved.hessians
        self.backtracks += solved.backtracks
        self.step_cap = min(self.step_cap, solved.step_cap)
        for remedy, count in solved.remedies.items():
            self.remedies[remedy] += count

    def record(self) -> dict:
        """The log's record: everything but the positions."""
        return {key: value for key, value in vars(self).items() if key != "positions"}


def peak_memory(comm: MPI.Comm) -> float:
    """The most memory that one rank's process has held so far [MB]. Collective."""
    return round(comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, op=MPI.MAX), 1)
