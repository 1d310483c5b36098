"""Reports of solves and steps: seconds by part, the remedies taken, and the counts of a Newton solve and of a step.

Remedies (docs/faq.md) are tried in this order where a solve does not go on. Each step counts how often each was taken.

| remedy | what | after |
|---|---|---|
| clamp | the Hessian projected again | an unprojected one turned out indefinite |
| abs | the strongest projection: eigenvalues by size, full contact Hessians | the line search failed |
| direct | a direct solver | an iterative one failed, or the line search failed with the strongest projection |
| workspace | more memory for the direct solver | it failed |
| halvings | half the step | all of these, or too many iterations |
| last_resort | the smallest step again with the strongest projection and the direct solver | no more halving |

After the last one comes `ConvergenceError`, which names level, step and reason; finished steps are kept. What is not a
number ends the run at once. `substeps` counts the parts into which a scripted motion was cut because contact stood in
its way.
"""

import resource
import time
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from pdvol.levels.space import LevelSpace

PARTS = ("assembly", "contact", "ccd", "linear")


class Stopwatch:
    """Seconds by part; what is measured inside another part counts for the inner one only."""

    def __init__(self) -> None:
        self.cpu = self.cpu_start = self.mark = 0.0
        self.open: list[_Part] = []  # outermost first; time since `mark` is of the last one
        self._parts: dict[str, _Part] = {}

    def part(self, name: str) -> "_Part":
        """Adds the time spent inside to `name`."""
        return self._parts.setdefault(name, _Part(self))

    def report(self) -> dict[str, float]:
        """Seconds: total, each part, the rest as `other`, and `cpu`, the process's CPU time in all. Starts over."""
        cpu, self.cpu = self.cpu, 0.0
        spent = {name: part.seconds for name, part in self._parts.items()}
        for part in self._parts.values():
            part.seconds = 0.0
        parts = {name: spent.pop(name, 0.0) for name in PARTS}
        other = sum(spent.values())
        return {"total": other + sum(parts.values()), **parts, "other": other, "cpu": cpu}


class _Part:
    """A context that a stopwatch measures, without the cost of a generator: an iteration enters 17."""

    __slots__ = ("_watch", "seconds")

    def __init__(self, watch: Stopwatch):
        self._watch, self.seconds = watch, 0.0

    def __enter__(self) -> None:
        watch, now = self._watch, time.perf_counter()
        if watch.open:
            watch.open[-1].seconds += now - watch.mark
        else:
            watch.cpu_start = time.process_time()
        watch.open.append(self)
        watch.mark = now

    def __exit__(self, *raised: object) -> None:
        watch, now = self._watch, time.perf_counter()
        self.seconds += now - watch.mark
        watch.open.pop()
        watch.mark = now
        if not watch.open:
            watch.cpu += time.process_time() - watch.cpu_start


REMEDIES = ("clamp", "abs", "direct", "workspace", "halvings", "last_resort", "substeps")


def no_remedies() -> dict[str, int]:
    """A count of zero for each remedy."""
    return dict.fromkeys(REMEDIES, 0)


def taken(remedies: dict[str, int]) -> str:
    """The remedies taken, for a message; empty where none was."""
    return ", ".join(f"{name} {count}" for name, count in remedies.items() if count)


@dataclass
class NewtonReport:
    """What one solve did.

    Attributes
    ----------
    converged : bool
    reason : PETSc's name of why it stopped; "ROUNDING" where the energy cannot fall any further in double precision
    iterations, linear_iterations, backtracks : int
    hessians : matrices assembled; other iterations took the one before
    step_cap : smallest cap put on a step by contact or inversion
    gradient_norm : infinity norm of the gradient [kg m]
    speed : size of the last full Newton step [m/s]
    imbalance : what is left of the forces on a body, over the largest of them
    remedies : how often each remedy was taken
    """

    converged: bool = False
    reason: str = ""
    iterations: int = 0
    linear_iterations: int = 0
    hessians: int = 0
    backtracks: int = 0
    step_cap: float = 1.0
    gradient_norm: float = np.inf
    speed: float = np.inf
    imbalance: float = 0.0
    remedies: dict[str, int] = field(default_factory=no_remedies)


@dataclass
class StepReport:
    """One finished step of one level, with its state: a record of `log.jsonl` (docs/command_line.md).

    Attributes
    ----------
    level : its number, 0 the coarsest
    step, time : number of the step, from 1, and the time at its end [s]
    positions : (n, d) [m], in the input's vertex order, on every rank
    velocity : (n, d) [m/s] as the integrator gives it, the same
    forces : (n, d) [N] of each term, by its name, and of inertia, the same; empty unless the march has them reported
    newton_iterations, linear_iterations, backtracks : sums over all solves of the step
    hessians : matrices assembled
    step_cap : smallest cap put on an iteration's step by contact or inversion
    contacts : pairs in contact
    min_gap : smallest gap within reach [m]; None where there is none
    energy : [J] of each term, by its name, and of inertia
    gradient_norm : infinity norm of the gradient [kg m]
    imbalance : what the last solve left of the forces on a body, over the largest of them
    reason : why the last solve ended, by PETSc's name
    linear_solver : the method of the last linear solve
    seconds : by part, and in all; `cpu` is the CPU time of all ranks
    peak_memory_mb : the most memory that one rank's process has held so far [MB]
    ranks : MPI ranks on which the step was made
    friction_iterations : solves with friction lagged anew, over all parts of a step that was cut
    friction_residual : change of the friction forces at the end if they were lagged anew there, relative to them
    kappa : stiffness of the barrier [Pa]
    reached : share of the step's scripted motion that was carried out, at least
    struck : how many steps of implicit Euler in a row, this one included, a blow fell in: the integrator begins anew
    terms : what the next step needs to know of the terms, by their names (`Term.memory`)
    behind : [s] how far scripted motions are behind the time at the step's end, at most, because contact stops them
    late : the same of each motion that is behind, by its name, where they are not all equally far behind
    cuts : how often the step was halved
    solver_memory : what the next step's linear solves begin with (`LinearSolver.memory`)
    remedies : how often each remedy was taken
    """

    level: int
    step: int
    time: float
    positions: np.ndarray
    velocity: np.ndarray
    forces: dict[str, np.ndarray] = field(default_factory=dict)
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
    imbalance: float = 0.0
    reason: str = ""
    linear_solver: str = ""
    solver_memory: dict = field(default_factory=dict)
    cuts: int = 0
    reached: float = 1.0
    behind: float = 0.0
    late: dict[str, float] = field(default_factory=dict)
    struck: int = 0
    terms: dict = field(default_factory=dict)
    remedies: dict[str, int] = field(default_factory=no_remedies)
    seconds: dict[str, float] = field(default_factory=dict)
    peak_memory_mb: float = 0.0
    ranks: int = 1

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
        """What the log keeps: everything but the arrays."""
        return {key: value for key, value in vars(self).items() if key not in ("positions", "velocity", "forces")}

    def measure(self, watch: Stopwatch, space: LevelSpace) -> None:
        """Notes what the step has cost on all ranks. Collective."""
        self.seconds, self.ranks = watch.report(), space.comm.size
        self.seconds["cpu"] = space.reduce(self.seconds["cpu"])
        self.peak_memory_mb = round(space.reduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, MPI.MAX), 1)
