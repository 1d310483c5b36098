"""Linear solvers for Newton's systems: which one, and PETSc options behind a prefix of their own."""

from itertools import count

from petsc4py import PETSc

from pdvol.errors import InputError, SimulationError
from pdvol.scene import Solver

DIRECT_UNTIL = 6_000  # unknowns: below, a sparse Cholesky costs no more than a preconditioner that may need help
# MUMPS estimates its work array from the pattern and gives up (INFOG(1) = -9) where pivoting on several ranks needs more.
WORKSPACES = (100, 400, 1600)  # per cent on top of the estimate, tried in turn
_serial = count()


class LinearSolver:
    """A KSP with pdvol's choice of method and the user's options on top.

    `auto` takes MUMPS' Cholesky for small systems and conjugate gradients with an incomplete Cholesky (block Jacobi of it on several
    ranks) for large ones: inertia makes those easy, and a solve that fails falls back to the direct method (`fall_back`).
    """

    def __init__(self, ksp: PETSc.KSP, settings: Solver, unknowns: int):
        self.ksp, self.settings = ksp, settings
        self.method = settings.linear
        if self.method == "auto":
            self.method = "direct" if unknowns <= DIRECT_UNTIL else "iterative"
        self._workspace = 0
        self.prefix = f"pdvol_{next(_serial)}_"
        ksp.setOptionsPrefix(self.prefix)
        self._configure()

    def _configure(self) -> None:
        ksp = self.ksp
        if self.method == "direct":
            ksp.setType(PETSc.KSP.Type.PREONLY)
            ksp.pc.setType(PETSc.PC.Type.CHOLESKY)
            ksp.pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
            self._with_options({"mat_mumps_icntl_14": str(WORKSPACES[self._workspace])})
        else:
            ksp.setType(PETSc.KSP.Type.CG)
            ksp.setNormType(PETSc.KSP.NormType.NATURAL)
            ksp.setTolerances(rtol=1e-4, max_it=1000)
            if ksp.comm.size == 1:
                ksp.pc.setType(PETSc.PC.Type.ICC)
            else:
                ksp.pc.setType(PETSc.PC.Type.BJACOBI)
                self._with_options({"sub_pc_type": "icc"})
        self._with_options(_parse(self.settings.petsc))

    def _with_options(self, options: dict[str, str]) -> None:
        database = PETSc.Options()
        database.prefixPush(self.prefix)
        for name, value in options.items():
            database.setValue(name, value)
        self.ksp.setFromOptions()
        for name in options:
            database.delValue(name)
        database.prefixPop()

    def fall_back(self) -> bool:
        """Switches to the direct method, or gives it more room; False when nothing is left to try."""
        if self.method == "direct":
            if self._workspace + 1 == len(WORKSPACES):
                return False
            self._workspace += 1
            operators = self.ksp.getOperators()
            self.ksp.pc.reset()  # the factor keeps the options it was made with
            self.ksp.setOperators(*operators)
        self.method = "direct"
        self._configure()
        return True

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solves with the operators set on the KSP. Raises SimulationError where every method fails. Collective."""
        self.ksp.solve(right, solution)
        while self.ksp.getConvergedReason() < 0 and self.fall_back():
            self.ksp.solve(right, solution)
        if self.ksp.getConvergedReason() < 0:
            raise SimulationError(f"the linear solve failed (PETSc's reason {self.ksp.getConvergedReason()})")


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
