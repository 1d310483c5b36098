"""Whether PETSc takes a user's options, known before anything is meshed."""

import ctypes
from contextlib import suppress
from itertools import count

import numpy as np

from pdvol.compat import PETSc
from pdvol.errors import InputError
from pdvol.scene import Solver
from pdvol.solve.linear.petsc_methods import parse_options, set_options

TRIED_ROWS = 200  # of the matrix that options are tried on: multigrid has two levels there
_serial = count()


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
