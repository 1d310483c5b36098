"""Work of one rank for all, as with files."""

import traceback
from collections.abc import Callable
from typing import Any, TypeVar

from mpi4py import MPI

from pdvol.errors import PdvolError

T = TypeVar("T")


def end_all(comm: MPI.Comm) -> None:
    """Shows the error of this rank alone, and ends all ranks: the others would wait for ever. Not of one rank."""
    if comm.size > 1:
        traceback.print_exc()
        comm.Abort(1)


def on_root(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """The result of rank 0's `work()` on every rank; its `PdvolError` is raised on every rank. Collective."""
    if comm.size == 1:
        return work()
    result: Any = None
    error: PdvolError | None = None
    cause: BaseException | None = None
    if comm.rank == 0:
        try:
            result = work()
        except PdvolError as raised:
            error, cause = raised, raised.__cause__
            raised.__cause__ = raised.__context__ = None  # only the error is sent: libraries' own may not be pickled
        except BaseException:
            end_all(comm)
            raise
    error = comm.bcast(error)
    if error is not None:
        raise error from cause
    return comm.bcast(result)
