"""Linear solvers for Newton's systems: the choice among three methods, and the user's PETSc options behind a prefix of
their own.

| method | what it is | `auto` uses it |
|---|---|---|
| iterative | conjugate gradients, incomplete Cholesky (by ranks, whose factors overlap) | first |
| multilevel | the same with a coarse space added | where it saves more than it costs |
| direct | MUMPS' Cholesky | for a system on which conjugate gradients failed; after two in a row to the step's end |

The first two are compiled (native/), unless the user's options name a `ksp_type` or a `pc_type`. Costs are iterations,
never times: runs repeat to the last bit.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from itertools import count
from types import SimpleNamespace

from mpi4py import MPI

from pdvol.compat import PETSc
from pdvol.errors import SimulationError
from pdvol.scene import Solver
from pdvol.solve.callbacks import weakly
from pdvol.solve.linear.coarse_space import CoarseSpace
from pdvol.solve.linear.petsc_methods import MUMPS_WORKSPACES, PetscMethods, set_options
from pdvol.solve.linear.system_matrix import SystemMatrix

LINEAR_METHODS = ("iterative", "multilevel", "direct")
# iterations that a current coarse operator has to save: summing and factoring it costs 2.5 to 4 with grids; three
# scenes took 0.94 to 1.09 of the time with 2 and 4 here
COARSE_SETUP = 8
# iterations at which conjugate gradients have failed: a direct solve costs about as much (400 to 1,000, from 500 to
# 20,000 vertices)
MAX_ITERATIONS = 500
_serial = count()
_Reasons = PETSc.KSP.ConvergedReason
# size of a block, over the mean of those on the diagonal beside it, below which the incomplete factor of smoothed
# elements leaves it out: they have 2.5 times the blocks of linear ones, and a factor takes 10 times as long; without
# weak blocks half of them are left, a factor takes a fifth of the time, and a solve 7 iterations instead of 6.
WEAK = 0.03


class ConjugateGradients:
    """The compiled conjugate gradients (native/gradients.c), with an incomplete factor and a coarse space where wanted.
    They solve with the last matrix. Factors and coarse operators are made when a solve needs them.

    Parameters
    ----------
    coarse : called when a coarse space is needed for the first time; gives them from the cheapest to the best
    dense : whether rows have so many blocks that the incomplete factor leaves out weak ones

    Attributes
    ----------
    system : SystemMatrix
        The last matrix.
    space : index of the coarse space in use
    is_current : whether the coarse operator serves for the next solve
    """

    def __init__(self, coarse: Callable[[], Sequence[CoarseSpace]], dense: bool):
        self._make_spaces, self._drop = coarse, WEAK if dense else 0.0
        self._spaces: Sequence[CoarseSpace] = ()
        self.space, self.is_current = 0, False
        self.system: SystemMatrix
        self._is_factored, self._is_definite = False, True
        self._fresh_iterations: int | None = None
        self._excess = 0

    @property
    def has_better(self) -> bool:
        """Whether there is a better coarse space than the one in use."""
        return self.space + 1 < len(self._spaces)

    def set_matrix(self, system: SystemMatrix) -> None:
        """After an assembly of `system`: the next solves are with it."""
        self.system, self._is_factored = system, False

    def prepare(self, with_coarse: bool) -> bool:
        """Factors a new matrix, and renews an outdated coarse operator if there is to be one. Returns whether the
        matrix may be positive definite: all diagonal blocks are. Collective.
        """
        system = self.system
        if not self._is_factored:
            tries = system.factor_incompletely(self._drop)
            if tries == 0:
                raise MemoryError("no memory left for the incomplete factor")
            self._is_definite, self._is_factored = system.space.reduce(tries > 0, MPI.LAND), True
        coarse = self._coarse_space() if with_coarse else None
        system.compiled.nodes = coarse.size if coarse is not None else 0
        if coarse is not None and coarse.size:
            if not self.is_current:
                self._is_definite = coarse.update(system.rows) and self._is_definite
                self.is_current, self._fresh_iterations = self._is_definite, None
            coarse.give(system.compiled)
        return self._is_definite

    def _coarse_space(self) -> CoarseSpace:
        self._spaces = self._spaces or self._make_spaces()
        return self._spaces[min(self.space, len(self._spaces) - 1)]

    def lost(self, iterations: int) -> int:
        """After a successful solve with a coarse space: how many iterations it has cost so far to keep its operator."""
        if self._fresh_iterations is None:
            self._fresh_iterations, self._excess = iterations, 0
        self._excess += iterations - self._fresh_iterations
        return self._excess


class LinearSolver:
    """A KSP that solves by pdvol's choice of method and, on top of it, the user's PETSc options.

    `set_matrix` takes each new matrix. A solve without a coarse space that takes many iterations goes on with one,
    and `note_iterations` leaves it where it does not pay.

    Parameters
    ----------
    ksp : becomes one that solves by this object
    coarse, dense : as `ConjugateGradients` takes them
    timed : makes the context in which solves run, for a stopwatch

    Attributes
    ----------
    method : the one of LINEAR_METHODS in use
    gradients : ConjugateGradients
    petsc : PetscMethods
    """

    def __init__(
        self,
        ksp: PETSc.KSP,
        settings: Solver,
        coarse: Callable[[], Sequence[CoarseSpace]],
        timed: Callable[[], AbstractContextManager[None]] = nullcontext,
        dense: bool = False,
    ):
        self.ksp, self.settings = ksp, settings
        self.gradients = ConjugateGradients(coarse, dense)
        self.petsc = PetscMethods(PETSc.KSP().create(ksp.comm), settings)
        self._failures = 0  # of conjugate gradients in a row, in this step
        self._first_method = "iterative" if settings.linear == "auto" else settings.linear
        ksp.setType(PETSc.KSP.Type.PYTHON)
        self._timed = timed
        ksp.setPythonContext(SimpleNamespace(solve=weakly(self._solve_ksp)))
        ksp.pc.setType(PETSc.PC.Type.NONE)
        prefix = f"pdvol_{next(_serial)}_"
        for solver in (ksp, self.petsc.ksp):
            solver.setOptionsPrefix(prefix)
            solver.setTolerances(rtol=settings.linear_rtol, max_it=MAX_ITERATIONS)
        self._use(self._first_method)

    def _use(self, method: str) -> None:
        self.method, self.gradients.is_current = method, False
        self._by_petsc = method == "direct" or self.petsc.are_named
        if self._by_petsc:
            self.petsc.use(method == "direct")
        else:
            set_options(self.ksp, self.petsc.options)

    @property
    def memory(self) -> dict:
        """The state that earlier steps leave to the next one: with the step's start and the settings it determines
        the step's result. `linear` is the setting under which it was learned.
        """
        return {
            "linear": self.settings.linear,
            "method": self._first_method,
            "coarse": self.gradients.space,
            "workspace": self.petsc.workspace,
        }

    def restore(self, memory: Mapping) -> None:
        """Restores the state of the solver whose `memory` this is.

        What was learned under another setting of `linear` is ignored, so that the method that the settings name is the
        one in use. So is a memory that no solver wrote.
        """
        method, space, workspace = memory.get("method"), memory.get("coarse", 0), memory.get("workspace")
        if (
            memory.get("linear", "auto") != self.settings.linear
            or method not in LINEAR_METHODS
            or not (isinstance(space, int) and space >= 0)
            or not (isinstance(workspace, int) and workspace >= 0)
        ):
            return
        self._first_method, self.gradients.space = method, space
        self.petsc.workspace = min(workspace, len(MUMPS_WORKSPACES) - 1)
        self._use(method)

    def begin_step(self) -> None:
        """Goes back from the direct method where that was a remedy, and marks the coarse operator as outdated: the step
        depends on its start and `memory` alone.
        """
        self.gradients.is_current, self._failures = False, 0
        if self.method != self._first_method:
            self._use(self._first_method)

    def set_matrix(self, system: SystemMatrix) -> None:
        """After an assembly of `system`: the next solves are with it. One system that took the direct method says
        little of the next one, two in a row do.
        """
        self.gradients.set_matrix(system)
        if self.method == "direct" and self._failures == 1 and self.petsc.has_solved:
            self._use(self._first_method)

    # ---- one solve

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec, near: bool = False) -> None:
        """Solves with the last matrix; `near` says that `solution` is near the one sought. Raises SimulationError where
        every method fails. Collective.
        """
        self.ksp.setOperators(self.gradients.system.shell)
        self.ksp.setInitialGuessNonzero(near)
        self.ksp.solve(right, solution)
        self.ksp.setInitialGuessNonzero(False)
        while self.ksp.getConvergedReason() < 0 and self.fall_back():
            self.ksp.solve(right, solution)
        if self.ksp.getConvergedReason() < 0:
            raise SimulationError(f"the linear solve failed (PETSc's reason {self.ksp.getConvergedReason()})")
        self.note_iterations(self.ksp.getIterationNumber())

    def _solve_ksp(self, ksp: PETSc.KSP, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """What PETSc calls to solve by `ksp`. Collective."""
        with self._timed():
            reason, iterations = self.solve_once(right, solution, ksp.getInitialGuessNonzero())
        ksp.setIterationNumber(iterations)
        ksp.setConvergedReason(reason)

    def solve_once(self, right: PETSc.Vec, solution: PETSc.Vec, near: bool = False) -> tuple[int, int]:
        """One try by the present method: PETSc's reason, and the number of iterations. The compiled one begins at
        `solution` where that is `near` the one sought, and goes on with a coarse space after many iterations if it
        may choose. Collective.
        """
        gradients, with_coarse = self.gradients, self.method == "multilevel"
        if self._by_petsc:
            return self.petsc.solve(gradients.system, right, solution)
        if not gradients.prepare(with_coarse):
            return _Reasons.DIVERGED_INDEFINITE_MAT, 0
        tolerance, _, _, most = self.ksp.getTolerances()
        start = solution.getArray(readonly=True) if near else None
        enough = self._enough(most)
        found, reason, iterations = gradients.system.solve(right.getArray(readonly=True), tolerance, enough, start)
        solution.setArray(found)
        if enough < most and reason == _Reasons.DIVERGED_MAX_IT:
            if with_coarse:
                gradients.space += 1
            self._change("multilevel")
            reason, more = self.solve_once(right, solution, True)
            iterations += more
        if reason > 0 and not near:
            self._failures = 0
        return reason, iterations

    def _enough(self, most: int) -> int:
        """Iterations, at most `most`, after which a (better) coarse space is used: it saves half or more."""
        if self.method == "multilevel":
            return min(most, 4 * COARSE_SETUP) if self.gradients.has_better else most
        return min(most, 2 * COARSE_SETUP) if self.settings.linear == "auto" else most

    # ---- the choice

    def note_iterations(self, iterations: int) -> None:
        """After a successful solve with this number of iterations: whether the next one has a coarse space, and whether
        that is renewed.
        """
        if self.method != "multilevel":
            return
        if self.settings.linear == "auto" and 2 * iterations < COARSE_SETUP:
            self._change("iterative")
        else:
            # renewed once what it has cost to keep it would have paid for that
            self.gradients.is_current = self.gradients.lost(iterations) <= COARSE_SETUP

    def _change(self, method: str) -> None:
        self._first_method = method
        self._use(method)

    def fall_back(self) -> bool:
        """After a failure: the direct method, then a larger work array for it. False when nothing is left to try."""
        if self.method != "direct":
            self._failures += 1
        elif not self.petsc.enlarge_workspace():
            return False
        self._use("direct")
        return True

    def use_direct(self) -> bool:
        """Uses the direct method from the next solve to the step's end. Returns False where it was asked for before."""
        if self.method == "direct" and self._failures != 1:
            return False
        self._failures = 0
        self._use("direct")
        return True

    @property
    def detects_indefinite(self) -> bool:
        """Whether an indefinite matrix is detected: by a failure of conjugate gradients, or `found_indefinite`."""
        return self.method != "direct" or self.petsc.counts_pivots

    @property
    def found_indefinite(self) -> bool:
        """Whether the last solve was direct and met negative pivots. Collective."""
        return self.method == "direct" and self.detects_indefinite and self.petsc.negative_pivots > 0
