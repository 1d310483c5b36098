"""Linear solvers for Newton's systems: which one, by what the problem turns out to be, and PETSc options behind a prefix of their own.

| method | what it is | `auto` takes it |
|---|---|---|
| iterative | conjugate gradients, incomplete Cholesky (block Jacobi of it on several ranks) | first, on small levels: inertia makes systems easy |
| multilevel | the same with a coarse space added | first, on large levels; on small ones once `iterative` takes many iterations |
| direct | MUMPS' Cholesky | where the others take more iterations than it costs, or fail |
"""

from collections.abc import Callable
from itertools import count

from petsc4py import PETSc

from pdvol.errors import InputError, SimulationError
from pdvol.scene import Solver
from pdvol.solve.coarse_space import CoarseSpace

METHODS = ("iterative", "multilevel", "direct")
LARGE = 2_000  # vertices from which on the coarse space pays for its set-up at once
MANY = 40  # iterations after which `iterative` hands over to `multilevel`
HARD = 200  # iterations that cost more than a direct solve: from 500 to 20,000 vertices that takes as long as 100 to 400
PATIENCE = 20  # direct solves after which the others are tried again
STALE = 1.5  # growth of the iteration count at which the coarse space is summed again
# MUMPS estimates its work array from the pattern and gives up (INFOG(1) = -9) where pivoting on several ranks needs more.
WORKSPACES = (100, 400, 1600)  # per cent on top of the estimate, tried in turn
_serial = count()


class LinearSolver:
    """A KSP with pdvol's choice of method and the user's options on top.

    Parameters
    ----------
    ksp : PETSc.KSP
    settings : Solver
    vertices : of the level
    coarse : called when a coarse space is wanted for the first time

    Attributes
    ----------
    method : one of METHODS, the one in use
    """

    def __init__(self, ksp: PETSc.KSP, settings: Solver, vertices: int, coarse: Callable[[], CoarseSpace]):
        self.ksp, self.settings, self._make_coarse = ksp, settings, coarse
        self._coarse: CoarseSpace | None = None
        self._workspace, self._direct_solves, self._parts, self._fresh, self._good = 0, 0, (), False, None
        self._easy = "multilevel" if vertices >= LARGE else "iterative"
        self.prefix = f"pdvol_{next(_serial)}_"
        ksp.setOptionsPrefix(self.prefix)
        self._use(self._easy if settings.linear == "auto" else settings.linear)

    def _use(self, method: str) -> None:
        self.method, ksp = method, self.ksp
        operators = ksp.getOperators()
        ksp.pc.reset()  # a factor keeps the options it was made with
        if method == "direct":
            self._direct_solves = 0
            ksp.setType(PETSc.KSP.Type.PREONLY)
            ksp.pc.setType(PETSc.PC.Type.CHOLESKY)
            ksp.pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
            self._with_options({"mat_mumps_icntl_14": str(WORKSPACES[self._workspace])})
        else:
            ksp.setType(PETSc.KSP.Type.CG)
            ksp.setNormType(PETSc.KSP.NormType.NATURAL)
            ksp.setTolerances(rtol=self.settings.accuracy, max_it=1000)
            if method == "multilevel":
                self._coarse, self._fresh = self._coarse or self._make_coarse(), False
                ksp.pc.setType(PETSc.PC.Type.PYTHON)
                ksp.pc.setPythonContext(_TwoLevel(ksp.comm, self._coarse, self._set_incomplete))
            else:
                self._set_incomplete(ksp.pc, self.prefix)
        self._with_options(_parse(self.settings.petsc))
        ksp.setOperators(*operators)

    @staticmethod
    def _set_incomplete(pc: PETSc.PC, prefix: str) -> None:
        """Incomplete Cholesky of this rank's diagonal block."""
        if pc.comm.size == 1:
            pc.setType(PETSc.PC.Type.ICC)
            return
        pc.setType(PETSc.PC.Type.BJACOBI)
        database = PETSc.Options()
        database[f"{prefix}sub_pc_type"] = "icc"
        pc.setFromOptions()

    def _with_options(self, options: dict[str, str]) -> None:
        database = PETSc.Options()
        for name, value in options.items():
            database[f"{self.prefix}{name}"] = value
        self.ksp.setFromOptions()

    def follow(self, parts) -> None:
        """Tells of a new matrix: `parts` as `CoarseSpace.update` takes them. Collective."""
        self._parts = parts
        if self.method == "multilevel" and not self._fresh:
            self._refresh()

    def _refresh(self) -> None:
        self._coarse.update(self._parts)
        self._fresh, self._good = True, None

    def learn(self, iterations: int) -> None:
        """Takes note of a solve that went well, and picks what solves the next one."""
        if self.settings.linear != "auto":
            self._watch_coarse(iterations)
        elif self.method == "direct":
            self._direct_solves += 1
            if self._direct_solves >= PATIENCE and self._workspace == 0:
                self._use(self._easy)
        elif iterations > HARD:
            self._use("direct")
        elif self.method == "iterative" and iterations > MANY:
            self._easy = "multilevel"
            self._use("multilevel")
        else:
            self._watch_coarse(iterations)

    def _watch_coarse(self, iterations: int) -> None:
        if self.method != "multilevel":
            return
        if self._good is None:
            self._good = iterations
        elif iterations > STALE * self._good + 2:
            self._fresh = False

    def fall_back(self) -> bool:
        """Switches to the direct method, or gives it more room; False when nothing is left to try."""
        if self.method == "direct":
            if self._workspace + 1 == len(WORKSPACES):
                return False
            self._workspace += 1
        self._use("direct")
        return True

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solves with the operators set on the KSP. Raises SimulationError where every method fails. Collective."""
        self.ksp.solve(right, solution)
        while self.ksp.getConvergedReason() < 0 and self.fall_back():
            self.ksp.solve(right, solution)
        if self.ksp.getConvergedReason() < 0:
            raise SimulationError(f"the linear solve failed (PETSc's reason {self.ksp.getConvergedReason()})")
        self.learn(self.ksp.getIterationNumber())


class _TwoLevel:
    """A PETSc preconditioner in Python: the incomplete factor's answer plus the coarse space's."""

    def __init__(self, comm, coarse: CoarseSpace, set_local: Callable[[PETSc.PC, str], None]):
        self.coarse = coarse
        self.local = PETSc.PC().create(comm)
        prefix = f"pdvol_local_{next(_serial)}_"
        self.local.setOptionsPrefix(prefix)
        set_local(self.local, prefix)

    def setUp(self, pc: PETSc.PC) -> None:
        self.local.setOperators(*pc.getOperators())
        self.local.setUp()

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self.local.apply(x, y)
        if self.coarse.size:
            residual = x.getArray(readonly=True).reshape(-1, self.coarse.space.dim)
            y.setArray(y.getArray(readonly=True) + self.coarse.correct(residual).ravel())


def _parse(text: str) -> dict[str, str]:
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
