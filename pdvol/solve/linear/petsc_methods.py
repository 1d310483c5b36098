"""Linear solves by PETSc's own methods: MUMPS' Cholesky, and what the user's options name; and whether PETSc takes
these, known before anything is meshed.
"""

import ctypes
from contextlib import suppress
from itertools import count

import numpy as np

from pdvol.compat import PETSc
from pdvol.errors import InputError
from pdvol.scene import Solver
from pdvol.solve.linear.system_matrix import SystemMatrix

# per cent on top of MUMPS' estimate of its work array, tried in turn: it estimates from the pattern and gives up
# (INFOG(1) = -9) where pivoting on several ranks needs more
MUMPS_WORKSPACES = (100, 400, 1600)
LIBRARY_ERROR = 76  # PETSC_ERR_LIB, without a unit: PETSc's code for an error of a library that it calls
TRIED_ROWS = 200  # of the matrix that options are tried on: multigrid has two levels there
_serial = count()


class PetscMethods:
    """A KSP behind a prefix of its own, which takes the user's PETSc options.

    Attributes
    ----------
    options : the user's
    workspace : index in MUMPS_WORKSPACES of the one in use
    has_solved : whether a system was solved since `use`
    """

    def __init__(self, ksp: PETSc.KSP, settings: Solver):
        self.ksp, self.options = ksp, parse_options(settings.petsc)
        self.workspace, self.has_solved = 0, False

    @property
    def are_named(self) -> bool:
        """Whether the user's options name a method."""
        return any(name in self.options for name in ("ksp_type", "pc_type"))

    def use(self, direct: bool) -> None:
        """Solves by Cholesky's factor from now on, or by conjugate gradients, but for what the options name."""
        ksp, self.has_solved = self.ksp, False
        ksp.reset()  # a factor keeps the options it was made with
        if direct:
            ksp.setType(PETSc.KSP.Type.PREONLY)
            ksp.pc.setType(PETSc.PC.Type.CHOLESKY)
            ksp.pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
            set_options(ksp, {"mat_mumps_icntl_14": str(MUMPS_WORKSPACES[self.workspace])})
        else:
            ksp.setType(PETSc.KSP.Type.CG)
        set_options(ksp, self.options)

    def solve(self, system: SystemMatrix, right: PETSc.Vec, solution: PETSc.Vec) -> tuple[int, int]:
        """PETSc's reason, and the number of iterations. Collective."""
        self.ksp.setOperators(system.petsc)
        try:
            self.ksp.solve(right, solution)
        except PETSc.Error as error:  # MUMPS was called once more after a factorisation that had failed
            if error.ierr != LIBRARY_ERROR:
                raise
            self.ksp.reset()
            return PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED, 0
        self.has_solved = self.ksp.getConvergedReason() > 0
        return self.ksp.getConvergedReason(), self.ksp.getIterationNumber()

    def enlarge_workspace(self) -> bool:
        """Gives MUMPS a larger work array from the next `use` on; False where it has the largest."""
        if self.workspace + 1 == len(MUMPS_WORKSPACES):
            return False
        self.workspace += 1
        return True

    @property
    def counts_pivots(self) -> bool:
        """Whether a factor would know its negative pivots."""
        pc = self.ksp.pc
        return pc.getType() == PETSc.PC.Type.CHOLESKY and pc.getFactorSolverType() == PETSc.Mat.SolverType.MUMPS

    @property
    def negative_pivots(self) -> int:
        """Of the last factor. Collective."""
        return self.ksp.pc.getFactorMatrix().getMumpsInfog(12)


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


def check_options(settings: Solver) -> None:
    """InputError where PETSc does not take the user's options or makes no use of them, before anything is made of them:
    they are tried on a small matrix.
    """
    options = parse_options(settings.petsc)
    if not options:
        return
    database = PETSc.Options(f"pdvol_tried_{next(_serial)}_")
    try:
        for direct in (False, True):
            _try_options(options, database.prefix, direct)
    except PETSc.Error as error:
        reason = str(error).splitlines()[-1].rpartition("] ")[2]
        raise InputError(f'Solver.petsc = "{settings.petsc}": {reason}') from None
    unused = [f"-{name}" for name in options if not _is_used(database.prefix + name)]
    for name in options:
        database.delValue(name)
    if unused:
        raise InputError(f'Solver.petsc = "{settings.petsc}": PETSc makes no use of {", ".join(unused)}; leave it out')


def _is_used(name: str) -> bool:
    """Whether PETSc has looked at an option; petsc4py has no name for that."""
    used = ctypes.c_int(0)
    ctypes.CDLL(PETSc.__file__).PetscOptionsUsed(None, name.encode(), ctypes.byref(used))
    return bool(used.value)


def _try_options(options: dict[str, str], prefix: str, direct: bool) -> None:
    """A solver with these options on a small matrix, ready to solve. Options that do not fit to the matrix pass here:
    PETSc's error where they are used says more.
    """
    n = TRIED_ROWS
    diagonals = np.column_stack([np.full(n, -1.0), np.full(n, 2.0), np.full(n, -1.0)]).ravel()[1:-1]
    columns = (np.arange(n)[:, None] + (-1, 0, 1)).ravel()[1:-1].astype(PETSc.IntType)
    rows = np.concatenate([[0], np.arange(2, 3 * n - 3, 3), [3 * n - 2]]).astype(PETSc.IntType)
    matrix = PETSc.Mat().createAIJ((n, n), csr=(rows, columns, diagonals), comm=PETSc.COMM_SELF)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOptionsPrefix(prefix)
    ksp.setType(PETSc.KSP.Type.PREONLY if direct else PETSc.KSP.Type.CG)
    if direct:
        ksp.pc.setType(PETSc.PC.Type.CHOLESKY)
        ksp.pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
    ksp.setOperators(matrix)
    try:
        set_options(ksp, options)
        with suppress(PETSc.Error):
            ksp.setUp()
            ksp.setUpOnBlocks()
    finally:
        ksp.destroy()
        matrix.destroy()
