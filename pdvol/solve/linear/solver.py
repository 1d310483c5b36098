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
from weakref import proxy

from mpi4py import MPI

from pdvol.compat import PETSc
from pdvol.errors import InputError, SimulationError
from pdvol.scene import Solver
from pdvol.solve.linear.coarse_space import CoarseSpace
from pdvol.solve.linear.system_matrix import SystemMatrix

LINEAR_METHODS = ("iterative", "multilevel", "direct")
# iterations that a current coarse operator has to save: summing and factoring it costs 2.5 to 4 with grids; three
# scenes took 0.94 to 1.09 of the time with 2 and 4 here
COARSE_SETUP = 8
# iterations at which conjugate gradients have failed: a direct solve costs about as much (400 to 1,000, from 500 to
# 20,000 vertices)
MAX_ITERATIONS = 500
# per cent on top of MUMPS' estimate of its work array, tried in turn: it estimates from the pattern and gives up
# (INFOG(1) = -9) where pivoting on several ranks needs more
MUMPS_WORKSPACES = (100, 400, 1600)
# size of a block, over the mean of those on the diagonal beside it, below which the incomplete factor of smoothed
# elements leaves it out: they have 2.5 times the blocks of linear ones, and a factor takes 10 times as long; without
# weak blocks half of them are left, a factor takes a fifth of the time, and a solve 7 iterations instead of 6.
WEAK = 0.03
LIBRARY_ERROR = 76  # PETSC_ERR_LIB, without a unit: PETSc's code for an error of a library that it calls
_serial = count()
_Reasons = PETSc.KSP.ConvergedReason


class LinearSolver:
    """A KSP that solves by pdvol's choice of method and, on top of it, the user's PETSc options.

    `set_matrix` takes each new matrix. A solve without a coarse space that takes many iterations goes on with one,
    and `note_iterations` leaves it where it does not pay.

    Parameters
    ----------
    ksp : PETSc.KSP
        Becomes one that solves by this object.
    settings : Solver
    coarse : called when a coarse space is needed for the first time; gives them from the cheapest to the best
    timed : makes the context in which solves run, for a stopwatch
    dense : whether rows have so many blocks that the incomplete factor leaves out weak ones

    Attributes
    ----------
    method : the one of LINEAR_METHODS in use
    """

    def __init__(
        self,
        ksp: PETSc.KSP,
        settings: Solver,
        coarse: Callable[[], Sequence[CoarseSpace]],
        timed: Callable[[], AbstractContextManager[None]] = nullcontext,
        dense: bool = False,
    ):
        self.ksp, self.settings, self._make_coarse = ksp, settings, coarse
        self._spaces: Sequence[CoarseSpace] = ()
        self._space = 0  # index of the one in use
        self._system: SystemMatrix
        self._workspace = 0
        self._is_factored, self._coarse_is_current, self._is_definite = False, False, True
        self._failures = 0  # of conjugate gradients in a row, in this step
        self._has_solved = False  # a system, since the method was changed
        self._fresh_iterations: int | None = None
        self._excess = 0
        self._drop = WEAK if dense else 0.0
        self._options = parse_options(settings.petsc)
        self._first_method = "iterative" if settings.linear == "auto" else settings.linear
        self.prefix = f"pdvol_{next(_serial)}_"
        ksp.setType(PETSc.KSP.Type.PYTHON)
        ksp.setPythonContext(_Context(proxy(self), timed))  # PETSc keeps the context: see `callbacks.weakly`
        ksp.pc.setType(PETSc.PC.Type.NONE)
        self._inner = PETSc.KSP().create(ksp.comm)  # what PETSc's own methods run in
        for solver in (ksp, self._inner):
            solver.setOptionsPrefix(self.prefix)
            solver.setTolerances(rtol=settings.linear_rtol, max_it=MAX_ITERATIONS)
        self._use(self._first_method)

    def _use(self, method: str) -> None:
        self.method, inner = method, self._inner
        self._coarse_is_current = self._has_solved = False
        self._by_petsc = method == "direct" or any(name in self._options for name in ("ksp_type", "pc_type"))
        if not self._by_petsc:
            set_options(self.ksp, self._options)
            return
        inner.reset()  # a factor keeps the options it was made with
        if method == "direct":
            inner.setType(PETSc.KSP.Type.PREONLY)
            inner.pc.setType(PETSc.PC.Type.CHOLESKY)
            inner.pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
            set_options(inner, {"mat_mumps_icntl_14": str(MUMPS_WORKSPACES[self._workspace])})
        else:
            inner.setType(PETSc.KSP.Type.CG)
        set_options(inner, self._options)

    @property
    def memory(self) -> dict:
        """The state that earlier steps leave to the next one: with the step's start and the settings it determines
        the step's result. `linear` is the setting under which it was learned.
        """
        return {
            "linear": self.settings.linear,
            "method": self._first_method,
            "coarse": self._space,
            "workspace": self._workspace,
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
        self._first_method, self._space = method, space
        self._workspace = min(workspace, len(MUMPS_WORKSPACES) - 1)
        self._use(method)

    def begin_step(self) -> None:
        """Goes back from the direct method where that was a remedy, and marks the coarse operator as outdated: the step
        depends on its start and `memory` alone.
        """
        self._coarse_is_current, self._failures = False, 0
        if self.method != self._first_method:
            self._use(self._first_method)

    def set_matrix(self, system: SystemMatrix) -> None:
        """After an assembly of `system`: the next solves are with it. One system that took the direct method says
        little of the next one, two in a row do.
        """
        self._system, self._is_factored = system, False
        if self.method == "direct" and self._failures == 1 and self._has_solved:
            self._use(self._first_method)

    # ---- one solve

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec, near: bool = False) -> None:
        """Solves with the last matrix; `near` says that `solution` is near the one sought. Raises SimulationError where
        every method fails. Collective.
        """
        self.ksp.setOperators(self._system.shell)
        self.ksp.setInitialGuessNonzero(near)
        self.ksp.solve(right, solution)
        self.ksp.setInitialGuessNonzero(False)
        while self.ksp.getConvergedReason() < 0 and self.fall_back():
            self.ksp.solve(right, solution)
        if self.ksp.getConvergedReason() < 0:
            raise SimulationError(f"the linear solve failed (PETSc's reason {self.ksp.getConvergedReason()})")
        self.note_iterations(self.ksp.getIterationNumber())

    def solve_once(self, right: PETSc.Vec, solution: PETSc.Vec, near: bool = False) -> tuple[int, int]:
        """One try by the present method: PETSc's reason, and the number of iterations. The compiled one begins at
        `solution` where that is `near` the one sought, and goes on with a coarse space after many iterations if it
        may choose. Collective.
        """
        if self._by_petsc:
            self._inner.setOperators(self._system.petsc)
            try:
                self._inner.solve(right, solution)
            except PETSc.Error as error:  # MUMPS was called once more after a factorisation that had failed
                if error.ierr != LIBRARY_ERROR:
                    raise
                self._inner.reset()
                return _Reasons.DIVERGED_PCSETUP_FAILED, 0
            self._has_solved = self._inner.getConvergedReason() > 0
            return self._inner.getConvergedReason(), self._inner.getIterationNumber()
        self._prepare()
        if not self._is_definite:
            return _Reasons.DIVERGED_INDEFINITE_MAT, 0
        tolerance, _, _, most = self.ksp.getTolerances()
        start = solution.getArray(readonly=True) if near else None
        enough = self._enough(most)
        found, reason, iterations = self._system.solve(right.getArray(readonly=True), tolerance, enough, start)
        solution.setArray(found)
        if enough < most and reason == _Reasons.DIVERGED_MAX_IT:
            if self.method == "multilevel":
                self._space += 1
            self._change("multilevel")
            reason, more = self.solve_once(right, solution, True)
            iterations += more
        if reason > 0 and not near:
            self._failures = 0
        return reason, iterations

    def _enough(self, most: int) -> int:
        """Iterations, at most `most`, after which a solve goes on with a coarse space, or with a better one: that saves
        half of them, or more.
        """
        if self.method == "multilevel":
            return min(most, 4 * COARSE_SETUP) if self._space + 1 < len(self._spaces) else most
        return min(most, 2 * COARSE_SETUP) if self.settings.linear == "auto" else most

    def _prepare(self) -> None:
        """Factors a new matrix, and renews an outdated coarse operator. Collective."""
        system = self._system
        if not self._is_factored:
            self._is_definite, self._is_factored = self._factor_incompletely(), True
        coarse = self._coarse_space() if self.method == "multilevel" else None
        system.compiled.nodes = coarse.size if coarse is not None else 0
        if coarse is None or not coarse.size:
            return
        if not self._coarse_is_current:
            self._is_definite = coarse.update(system.rows) and self._is_definite
            self._coarse_is_current, self._fresh_iterations = self._is_definite, None
        coarse.give(system.compiled)

    def _coarse_space(self) -> CoarseSpace:
        self._spaces = self._spaces or self._make_coarse()
        return self._spaces[min(self._space, len(self._spaces) - 1)]

    def _factor_incompletely(self) -> bool:
        """Incomplete Cholesky factor of the new matrix. Returns whether the matrix may be positive definite: all
        diagonal blocks are. Collective.
        """
        tries = self._system.factor_incompletely(self._drop)
        if tries == 0:
            raise MemoryError("no memory left for the incomplete factor")
        return self._system.space.reduce(tries > 0, MPI.LAND)

    # ---- the choice

    def note_iterations(self, iterations: int) -> None:
        """After a successful solve with this number of iterations: whether the next one has a coarse space, and whether
        that is renewed.
        """
        if self.method != "multilevel":
            return
        if self.settings.linear == "auto" and 2 * iterations < COARSE_SETUP:
            self._change("iterative")
        elif self._fresh_iterations is None:
            self._fresh_iterations, self._excess = iterations, 0
        else:  # renewed once what it has cost to keep it would have paid for that
            self._excess += iterations - self._fresh_iterations
            self._coarse_is_current = self._excess <= COARSE_SETUP

    def _change(self, method: str) -> None:
        self._first_method = method
        self._use(method)

    def fall_back(self) -> bool:
        """After a failure: the direct method, then a larger work array for it. Returns False when nothing is left to
        try.
        """
        if self.method != "direct":
            self._failures += 1
        elif self._workspace + 1 < len(MUMPS_WORKSPACES):
            self._workspace += 1
        else:
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
        """Whether an indefinite matrix would be detected: by a failure of conjugate gradients, or by
        `found_indefinite`.
        """
        pc = self._inner.pc
        return self.method != "direct" or (
            pc.getType() == PETSc.PC.Type.CHOLESKY and pc.getFactorSolverType() == PETSc.Mat.SolverType.MUMPS
        )

    @property
    def found_indefinite(self) -> bool:
        """Whether the last solve was direct and met negative pivots. Collective."""
        return (
            self.method == "direct"
            and self.detects_indefinite
            and self._inner.pc.getFactorMatrix().getMumpsInfog(12) > 0
        )


class _Context:
    """What PETSc calls for a KSP of type python."""

    def __init__(self, solver: LinearSolver, timed: Callable[[], AbstractContextManager[None]]):
        self._solver, self._timed = solver, timed

    def solve(self, ksp: PETSc.KSP, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        with self._timed():
            reason, iterations = self._solver.solve_once(right, solution, ksp.getInitialGuessNonzero())
        ksp.setIterationNumber(iterations)
        ksp.setConvergedReason(reason)


def set_options(ksp: PETSc.KSP, options: dict[str, str]) -> None:
    """Gives options to a solver, which has a prefix of its own."""
    database = PETSc.Options(ksp.getOptionsPrefix())
    # options of factors are read late, and never where no factor is made: PETSc must not warn of them
    PETSc.Options()["options_left"] = "no"
    for name, value in options.items():
        database[name] = value
    ksp.setFromOptions()


def wants_general_matrix(settings: Solver) -> bool:
    """Whether the user's options name a preconditioner: it may not support symmetric blocked matrices."""
    return any(name.endswith("pc_type") for name in parse_options(settings.petsc))


def parse_options(text: str) -> dict[str, str]:
    """PETSc options "-a 1 -b" as a dictionary."""
    options: dict[str, str] = {}
    name = None
    for word in text.split():
        if word.startswith("-") and not word[1:2].isdigit():
            name = word.lstrip("-")
            options[name] = ""
        elif name is None:
            raise InputError(f'petsc = "{text}": options look like "-ksp_rtol 1e-6"')
        else:
            options[name], name = word, None
    return options
