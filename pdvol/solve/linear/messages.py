"""MPI for compiled loops, which call it in each iteration: through Python a message takes 5 to 40 us longer."""

import ctypes
import sys
from functools import cache
from typing import Any

from mpi4py import MPI

from pdvol.solve.linear import native


@cache
def library() -> ctypes.CDLL:
    """mpi4py's own module: its functions of MPI are those of the library that it uses."""
    return ctypes.CDLL(MPI.__file__)


def _handle(thing: Any) -> Any:
    """A handle of MPI as C has it: a pointer, or an int in the place of one."""
    number = int.from_bytes(ctypes.string_at(MPI._addressof(thing), MPI._sizeof(thing)), sys.byteorder)
    return native.ffi.cast("void *", number)


def ranks(comm: MPI.Comm) -> Any:
    """A `ranks_t *` of native/ with the functions and handles of MPI."""
    made = native.ffi.new("ranks_t *")
    made.comm, made.numbers, made.sum = _handle(comm), _handle(MPI.DOUBLE), _handle(MPI.SUM)
    made.in_place = native.ffi.cast("void *", int(MPI.IN_PLACE))
    fields = dict(native.ffi.typeof("ranks_t").fields)
    for kind, name in (("all_reduce", "MPI_Allreduce"), ("all_to_all", "MPI_Alltoallv")):
        address = ctypes.cast(getattr(library(), name), ctypes.c_void_p).value
        setattr(made, kind, native.ffi.cast(fields[kind].type, address))
    return made
