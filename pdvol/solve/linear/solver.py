"""Linear solvers for Newton's systems: which one, by what the problem turns out to be, and PETSc options behind a
prefix of their own.

| method | what it is | `auto` takes it |
|---|---|---|
| iterative | conjugate gradients, incomplete Cholesky (block Jacobi of it on several ranks) | first, on small levels |
| multilevel | the same with a coarse space added | first, on large levels; on small ones after many iterations |
| direct | MUMPS' Cholesky | where the others take more iterations than it costs, or fail |
"""

from collections.abc import Callable, Mapping
from itertools import count

import numpy as np
from petsc4py import PETSc

from pdvol.errors import InputError, SimulationError
from pdvol.scene import Solver
from pdvol.solve.linear.coarse_space import CoarseSpace

METHODS = ("iterative", "multilevel", "direct")
LARGE = 2_000  # vertices from which on the coarse space pays for its set-up at once
MANY = 40  # iterations after which `iterative` hands over to `multilevel`
# iterations that cost more than a direct solve: from 500 to 20,000 vertices that takes as long as 100 to 400
HARD = 200
PATIENCE = 20  # direct solves after which the others are tried again
# An incomplete factor of a positive definite matrix need not be one: stiff contacts break it, and slivers do. Diagonal
# blocks of rows in contact, and of all rows, then grow for its purposes by these shares in turn (Manteuffel 1980).
SHIFTS = ((0.0, 0.0), (0.1, 0.0), (0.1, 0.01), (0.2, 0.01), (0.2, 0.05), (0.4, 0.05), (0.8, 0.2))
STALE = 1.5  # growth of the iteration count at which the coarse space is summed again
# MUMPS estimates its work array from the pattern and gives up (INFOG(1) = -9) where pivoting on several ranks needs
# more.
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
        self._local = _Incomplete(ksp.comm)
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
            ksp.setNormType(
                PETSc.KSP.NormType.DEFAULT if "ksp_type" in _parse(self.settings.petsc) else PETSc.KSP.NormType.NATURAL
            )
            ksp.setTolerances(rtol=self.settings.accuracy, max_it=1000)
            if method == "multilevel":
                self._coarse, self._fresh = self._coarse or self._make_coarse(), False
            ksp.pc.setType(PETSc.PC.Type.PYTHON)
            ksp.pc.setPythonContext(_Preconditioner(self._local, self._coarse if method == "multilevel" else None))
        self._with_options(_parse(self.settings.petsc))
        ksp.setOperators(*operators)

    def _with_options(self, options: dict[str, str]) -> None:
        database = PETSc.Options()
        # factors read theirs late, or never where they are not made: nothing to warn of
        database["options_left"] = "no"
        for name, value in options.items():
            database[f"{self.prefix}{name}"] = value
        self.ksp.setFromOptions()

    @property
    def memory(self) -> dict:
        """What earlier solves have taught: the rest of what a step's result may depend on besides its start. `linear` is
        the setting under which it was learned.
        """
        return {
            "linear": self.settings.linear,
            "method": self.method,
            "easy": self._easy,
            "shift": self._local.shift,
            "workspace": self._workspace,
            "direct": self._direct_solves,
        }

    def recall(self, memory: Mapping) -> None:
        """Goes on as the solver did whose `memory` this is.

        What was learned under another setting of `linear` is ignored, so that the method that the settings name is the
        one in use. So is a memory that no solver wrote.
        """
        numbers = [memory.get(key) for key in ("shift", "workspace", "direct")]
        if (
            memory.get("linear", "auto") != self.settings.linear
            or not all(memory.get(key) in METHODS for key in ("method", "easy"))
            or not all(isinstance(number, int) and number >= 0 for number in numbers)
        ):
            return
        self._easy, self._local.shift, self._workspace = (
            memory["easy"],
            memory["shift"],
            min(memory["workspace"], len(WORKSPACES) - 1),
        )
        self._use(memory["method"])
        self._direct_solves = memory["direct"]

    def forget(self) -> None:
        """Before a step: the coarse space is summed anew, so that the step depends on its start and `memory` alone."""
        self._fresh = False
        if self._coarse is not None:
            self._coarse.forget()

    def follow(self, parts) -> None:
        """Tells of a new matrix: `parts` as `CoarseSpace.update` takes them. Collective."""
        self._parts = self._local.parts = parts
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
        """After a failure: a safer incomplete factor, then the direct method, then more room for it; False when nothing
        is left to try.
        """
        if (
            self.method != "direct"
            and self.ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC
            and self._local.shift_more()
        ):
            self._use(self.method)
            return True
        if self.method == "direct":
            if self._workspace + 1 == len(WORKSPACES):
                return False
            self._workspace += 1
        self._use("direct")
        return True

    def be_exact(self) -> bool:
        """The direct method from the next solve on; False where it is in use."""
        if self.method == "direct":
            return False
        self._use("direct")
        return True

    @property
    def notices_indefinite(self) -> bool:
        """Whether `indefinite` or a failure tells of an indefinite matrix."""
        pc = self.ksp.pc
        return self.method != "direct" or (
            pc.getType() == PETSc.PC.Type.CHOLESKY and pc.getFactorSolverType() == PETSc.Mat.SolverType.MUMPS
        )

    @property
    def indefinite(self) -> bool:
        """Whether the direct solve just done met negative pivots. Collective."""
        return (
            self.method == "direct" and self.notices_indefinite and self.ksp.pc.getFactorMatrix().getMumpsInfog(12) > 0
        )

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solves with the operators set on the KSP. Raises SimulationError where every method fails. Collective."""
        self.ksp.solve(right, solution)
        while self.ksp.getConvergedReason() < 0 and self.fall_back():
            self.ksp.solve(right, solution)
        if self.ksp.getConvergedReason() < 0:
            raise SimulationError(f"the linear solve failed (PETSc's reason {self.ksp.getConvergedReason()})")
        self.learn(self.ksp.getIterationNumber())


class _Incomplete:
    """Incomplete Cholesky of each rank's diagonal block, its diagonal strengthened where it must be.

    Attributes
    ----------
    parts : what the matrix was summed from (`SystemMatrix.parts`)
    shift : index into SHIFTS
    """

    def __init__(self, comm):
        self.parts, self.shift = (), 0
        self._pc = PETSc.PC().create(comm)
        prefix = f"pdvol_local_{next(_serial)}_"
        self._pc.setOptionsPrefix(prefix)
        if comm.size == 1:
            self._pc.setType(PETSc.PC.Type.ICC)
        else:
            self._pc.setType(PETSc.PC.Type.BJACOBI)
            PETSc.Options()[f"{prefix}sub_pc_type"] = "icc"
            self._pc.setFromOptions()

    def shift_more(self) -> bool:
        """Strengthens the diagonal from the next factor on; False when it already is as strong as it gets."""
        self.shift += 1
        return self.shift < len(SHIFTS)

    def factor(self, matrix: PETSc.Mat) -> None:
        at_contacts, everywhere = SHIFTS[min(self.shift, len(SHIFTS) - 1)]
        if at_contacts > 0.0:
            matrix = matrix.duplicate(copy=True)
            for starts, columns, blocks, touched in self._diagonals():
                shares = np.where(touched, at_contacts, everywhere)
                matrix.setValuesBlockedCSR(
                    starts, columns, shares[:, None, None] * blocks, addv=PETSc.InsertMode.ADD_VALUES
                )
            matrix.assemble()
        self._pc.setOperators(matrix)
        self._pc.setUp()

    def _diagonals(self):
        """Diagonal blocks of cells and of pairs, each as (starts, columns, blocks, whether the row is in contact)."""
        (cell_starts, cell_columns, cells), (starts, columns, pairs) = self.parts
        n = len(cell_starts) - 1
        rows = np.repeat(np.arange(n), np.diff(starts))
        first = cell_columns[0] if n else 0  # upper triangle: a row begins on its diagonal
        touched = np.zeros(n, dtype=bool)
        touched[rows] = True
        touched[columns[(columns >= first) & (columns < first + n)] - first] = True
        yield (
            np.arange(n + 1, dtype=PETSc.IntType),
            (first + np.arange(n)).astype(PETSc.IntType),
            cells[cell_starts[:-1]],
            touched,
        )
        on = np.flatnonzero(columns == first + rows)
        yield np.searchsorted(on, starts).astype(PETSc.IntType), columns[on], pairs[on], touched[rows[on]]

    def apply(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self._pc.apply(x, y)


class _Preconditioner:
    """A PETSc preconditioner in Python: the incomplete factor's answer, plus the coarse space's if there is one."""

    def __init__(self, local: _Incomplete, coarse: CoarseSpace | None):
        self.local, self.coarse = local, coarse

    def setUp(self, pc: PETSc.PC) -> None:
        self.local.factor(pc.getOperators()[1])

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self.local.apply(x, y)
        if self.coarse is not None and self.coarse.size:
            self.coarse.add_correction(x.getArray(readonly=True), y.getArray())


def wants_general_matrix(settings: Solver) -> bool:
    """Whether the user's own options pick a preconditioner, which may not take a symmetric blocked matrix."""
    return any(name.endswith("pc_type") for name in _parse(settings.petsc))


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
