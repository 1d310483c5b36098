"""What ranks do together: reductions, and work of one rank for all, as for files."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI

from pdvol.errors import PdvolError

T = TypeVar("T")


def reduce(comm: MPI.Comm, value: T, op: MPI.Op = MPI.SUM) -> T:
    """The sum of all ranks' numbers, or what else `op` makes of them: a number of the same type, or an array.
    Collective.

    An iteration asks many times. mpi4py takes 12 us on one rank (measured on a loaded machine), and longer for objects
    than for arrays.
    """
    if comm.size == 1:
        return value
    numbers = np.array(value, ndmin=1, dtype=np.int32 if op in (MPI.LAND, MPI.LOR) else np.float64)
    comm.Allreduce(MPI.IN_PLACE, numbers, op=op)
    return numbers if isinstance(value, np.ndarray) else type(value)(numbers[0])  # type: ignore[return-value, call-arg]


def on_root(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """The result of rank 0's `work()` on every rank; its `PdvolError` is raised on every rank. Collective."""
    result: Any = None
    error: PdvolError | None = None
    if comm.rank == 0:
        try:
            result = work()
        except PdvolError as raised:
            error = raised
        except BaseException:
            if comm.size > 1:
                import traceback

                traceback.print_exc()
                comm.Abort(1)  # the other ranks would wait for ever
            raise
    error = comm.bcast(error)
    if error is not None:
        raise error
    return comm.bcast(result)
