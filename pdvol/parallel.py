"""One rank does it, all ranks have it: for work that is not distributed, files above all."""

from collections.abc import Callable
from typing import Any, TypeVar

from mpi4py import MPI

from pdvol.errors import PdvolError

T = TypeVar("T")


def on_root(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """The result of `work()` done on rank 0, on every rank; an error pdvol raises there is raised on every rank.
    Collective.
    """
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
