"""Linear solvers for Newton's systems: the choice among three methods, and the user's PETSc options behind a prefix of
their own.

| method | what it is | `auto` uses it |
|---|---|---|
| iterative | conjugate gradients, incomplete Cholesky (block Jacobi of it on several ranks) | first, on small levels |
| multilevel | the same with a coarse space added | first, on large levels; on small ones after many iterations |
| direct | MUMPS' Cholesky | where the others take more iterations than it costs, or fail |
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import count

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pdvol.errors import InputError, SimulationError
from pdvol.scene import Solver
from pdvol.solve.linear.coarse_space import CoarseSpace
from pdvol.solve.linear.system_matrix import MatrixParts

LINEAR_METHODS = ("iterative", "multilevel", "direct")
# vertices: on larger levels the coarse space saves more time than its set-up takes, from the first solve on
COARSE_SPACE_VERTICES = 2_000
# iterations of one solve: after more of them `iterative` is replaced by `multilevel`
MAX_ITERATIONS_WITHOUT_COARSE_SPACE = 40
# iterations of one solve: more of them take longer than a direct solve (100 to 400 do, from 500 to 20,000 vertices)
MAX_CG_ITERATIONS = 200
# iterations at which conjugate gradients count as failed: twice and more what a direct solve costs at any size
CG_ITERATION_LIMIT = 1000
# solves: after so many direct ones conjugate gradients are tried again, for systems may have become easier
DIRECT_SOLVES = 20
# Shares of the diagonal blocks that are added to them before the incomplete factorization: of rows in contact, and of
# all rows. The incomplete factor of a positive definite matrix can be indefinite where contacts are stiff or cells are
# slivers; the shares are tried in turn until it is not (Manteuffel 1980).
DIAGONAL_SHIFTS = ((0.0, 0.0), (0.1, 0.0), (0.1, 0.01), (0.2, 0.01), (0.2, 0.05), (0.4, 0.05), (0.8, 0.2))
# ratio and number of iterations: a coarse operator is outdated when a solve takes more iterations than this ratio times
# those of its first solve, plus this number
COARSE_SPACE_GROWTH, COARSE_SPACE_MARGIN = 1.5, 2
# per cent on top of MUMPS' estimate of its work array, tried in turn: it estimates from the pattern and gives up
# (INFOG(1) = -9) where pivoting on several ranks needs more
MUMPS_WORKSPACES = (100, 400, 1600)
_serial = count()


class LinearSolver:
    """A KSP with pdvol's choice of method and, on top of it, the user's PETSc options.

    Before each solve `set_parts` takes the new matrix; after it `note_iterations` chooses the next
    one.

    Parameters
    ----------
    ksp : PETSc.KSP
    settings : Solver
    vertices : number of the level's vertices
    coarse : called when a coarse space is needed for the first time

    Attributes
    ----------
    method : the one of LINEAR_METHODS in use
    """

    def __init__(self, ksp: PETSc.KSP, settings: Solver, vertices: int, coarse: Callable[[], CoarseSpace]):
        self.ksp, self.settings, self._make_coarse = ksp, settings, coarse
        self._coarse: CoarseSpace | None = None
        self._workspace, self._direct_solves, self._coarse_is_current = 0, 0, False
        self._fresh_iterations: int | None = None
        self._local = _Incomplete(ksp.comm)
        self._cg_method = "multilevel" if vertices >= COARSE_SPACE_VERTICES else "iterative"
        self.prefix = f"pdvol_{next(_serial)}_"
        ksp.setOptionsPrefix(self.prefix)
        self._use(self._cg_method if settings.linear == "auto" else settings.linear)

    def _use(self, method: str) -> None:
        self.method, ksp = method, self.ksp
        operators = ksp.getOperators()
        ksp.pc.reset()  # a factor keeps the options it was made with
        if method == "direct":
            self._direct_solves = 0
            ksp.setType(PETSc.KSP.Type.PREONLY)
            ksp.pc.setType(PETSc.PC.Type.CHOLESKY)
            ksp.pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
            self._with_options({"mat_mumps_icntl_14": str(MUMPS_WORKSPACES[self._workspace])})
        else:
            ksp.setType(PETSc.KSP.Type.CG)
            ksp.setNormType(
                PETSc.KSP.NormType.DEFAULT if "ksp_type" in _parse(self.settings.petsc) else PETSc.KSP.NormType.NATURAL
            )
            ksp.setTolerances(rtol=self.settings.accuracy, max_it=CG_ITERATION_LIMIT)
            if method == "multilevel":
                self._coarse, self._coarse_is_current = self._coarse or self._make_coarse(), False
            ksp.pc.setType(PETSc.PC.Type.PYTHON)
            ksp.pc.setPythonContext(_Preconditioner(self._local, self._coarse if method == "multilevel" else None))
        self._with_options(_parse(self.settings.petsc))
        ksp.setOperators(*operators)

    def _with_options(self, options: dict[str, str]) -> None:
        database = PETSc.Options()
        # options of factors are read late, and never where no factor is made: PETSc must not warn of them
        database["options_left"] = "no"
        for name, value in options.items():
            database[f"{self.prefix}{name}"] = value
        self.ksp.setFromOptions()

    @property
    def memory(self) -> dict:
        """The state that earlier solves leave to the next step: with the step's start and the settings it determines
        the step's result. `linear` is the setting under which it was learned.
        """
        return {
            "linear": self.settings.linear,
            "method": self.method,
            "easy": self._cg_method,
            "shift": self._local.shift,
            "workspace": self._workspace,
            "direct": self._direct_solves,
        }

    def restore(self, memory: Mapping) -> None:
        """Restores the state of the solver whose `memory` this is.

        What was learned under another setting of `linear` is ignored, so that the method that the settings name is the
        one in use. So is a memory that no solver wrote.
        """
        numbers = [memory.get(key) for key in ("shift", "workspace", "direct")]
        if (
            memory.get("linear", "auto") != self.settings.linear
            or not all(memory.get(key) in LINEAR_METHODS for key in ("method", "easy"))
            or not all(isinstance(number, int) and number >= 0 for number in numbers)
        ):
            return
        self._cg_method, self._local.shift, self._workspace = (
            memory["easy"],
            memory["shift"],
            min(memory["workspace"], len(MUMPS_WORKSPACES) - 1),
        )
        self._use(memory["method"])
        self._direct_solves = memory["direct"]

    def forget(self) -> None:
        """Before a step: marks the coarse operator as outdated, so that the step depends on its start and `memory`
        alone.
        """
        self._coarse_is_current = False
        if self._coarse is not None:
            self._coarse.forget()

    def set_parts(self, parts: MatrixParts) -> None:
        """After a new matrix was assembled of these parts: updates an outdated coarse operator. Collective."""
        self._local.parts = parts
        if self.method == "multilevel" and self._coarse is not None and not self._coarse_is_current:
            self._coarse.update(parts)
            self._coarse_is_current, self._fresh_iterations = True, None

    def note_iterations(self, iterations: int) -> None:
        """After a successful solve with this number of iterations: chooses the method of the next one."""
        if self.settings.linear != "auto":
            self._watch_coarse(iterations)
        elif self.method == "direct":
            self._direct_solves += 1
            if self._direct_solves >= DIRECT_SOLVES and self._workspace == 0:
                self._use(self._cg_method)
        elif iterations > MAX_CG_ITERATIONS:
            self._use("direct")
        elif self.method == "iterative" and iterations > MAX_ITERATIONS_WITHOUT_COARSE_SPACE:
            self._cg_method = "multilevel"
            self._use("multilevel")
        else:
            self._watch_coarse(iterations)

    def _watch_coarse(self, iterations: int) -> None:
        if self.method != "multilevel":
            return
        if self._fresh_iterations is None:
            self._fresh_iterations = iterations
        elif iterations > COARSE_SPACE_GROWTH * self._fresh_iterations + COARSE_SPACE_MARGIN:
            self._coarse_is_current = False

    def fall_back(self) -> bool:
        """After a failure: a larger diagonal shift of the incomplete factor, then the direct method, then a larger work
        array for it. Returns False when nothing is left to try.
        """
        if (
            self.method != "direct"
            and self.ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC
            and self._local.shift_more()
        ):
            self._use(self.method)
            return True
        if self.method == "direct":
            if self._workspace + 1 == len(MUMPS_WORKSPACES):
                return False
            self._workspace += 1
        self._use("direct")
        return True

    def use_direct(self) -> bool:
        """Uses the direct method from the next solve on. Returns False where it is in use already."""
        if self.method == "direct":
            return False
        self._use("direct")
        return True

    @property
    def detects_indefinite(self) -> bool:
        """Whether an indefinite matrix would be detected: by a failure of conjugate gradients, or by
        `found_indefinite`.
        """
        pc = self.ksp.pc
        return self.method != "direct" or (
            pc.getType() == PETSc.PC.Type.CHOLESKY and pc.getFactorSolverType() == PETSc.Mat.SolverType.MUMPS
        )

    @property
    def found_indefinite(self) -> bool:
        """Whether the last solve was direct and met negative pivots. Collective."""
        return (
            self.method == "direct" and self.detects_indefinite and self.ksp.pc.getFactorMatrix().getMumpsInfog(12) > 0
        )

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solves with the operators set on the KSP. Raises SimulationError where every method fails. Collective."""
        self.ksp.solve(right, solution)
        while self.ksp.getConvergedReason() < 0 and self.fall_back():
            self.ksp.solve(right, solution)
        if self.ksp.getConvergedReason() < 0:
            raise SimulationError(f"the linear solve failed (PETSc's reason {self.ksp.getConvergedReason()})")
        self.note_iterations(self.ksp.getIterationNumber())


class _Incomplete:
    """Incomplete Cholesky factor of each rank's diagonal block, with a diagonal shift where it needs one.

    Attributes
    ----------
    parts : MatrixParts
        Their sum is the matrix.
    shift : index into DIAGONAL_SHIFTS
    """

    def __init__(self, comm: MPI.Comm):
        self.parts: MatrixParts
        self.shift = 0
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
        """Uses the next diagonal shift from the next factor on. Returns False after the last one."""
        self.shift += 1
        return self.shift < len(DIAGONAL_SHIFTS)

    def factor(self, matrix: PETSc.Mat) -> None:
        at_contacts, everywhere = DIAGONAL_SHIFTS[min(self.shift, len(DIAGONAL_SHIFTS) - 1)]
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

    def _diagonals(self) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Diagonal blocks of cells, then of pairs, as block CSR (starts, columns, blocks), and for each block whether
        its row is in contact.
        """
        (cell_starts, cell_columns, cells), (starts, columns, pairs) = self.parts
        n = len(cell_starts) - 1
        rows = np.repeat(np.arange(n), np.diff(starts))
        first = cell_columns[0] if n else 0  # rows of the upper triangle begin on the diagonal
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
    """PETSc's Python preconditioner: the incomplete factor's correction plus, with a coarse space, the coarse one."""

    def __init__(self, local: _Incomplete, coarse: CoarseSpace | None):
        self.local, self.coarse = local, coarse

    def setUp(self, pc: PETSc.PC) -> None:
        self.local.factor(pc.getOperators()[1])

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self.local.apply(x, y)
        if self.coarse is not None and self.coarse.size:
            self.coarse.add_correction(x.getArray(readonly=True), y.getArray())


def wants_general_matrix(settings: Solver) -> bool:
    """Whether the user's options name a preconditioner: it may not support symmetric blocked matrices."""
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
