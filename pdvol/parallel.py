"""What ranks do together: reductions, and work of one rank for all, as for files."""

from collections.abc import Callable
from typing import Any, TypeVar

from mpi4py import MPI

from pdvol.errors import PdvolError

T = TypeVar("T")


def reduce(comm: MPI.Comm, value: T, op: MPI.Op = MPI.SUM) -> T:
    """The sum of all ranks' values, or what else `op` makes of them. Collective.

    mpi4py takes 12 us on one rank (measured on a loaded machine), and an iteration asks many times.
    """
    return value if comm.size == 1 else comm.allreduce(value, op=op)


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
