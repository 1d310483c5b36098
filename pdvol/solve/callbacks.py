"""What PETSc calls: without keeping it alive, and with its errors."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from weakref import WeakMethod

from pdvol.compat import PETSc
from pdvol.errors import SimulationError


@contextmanager
def own_errors() -> Iterator[None]:
    """Raises a callback's error instead of PETSc's. PETSc's own errors become `SimulationError`."""
    try:
        yield
    except PETSc.Error as error:
        cause: BaseException | None = error
        while isinstance(cause, PETSc.Error):  # more than one where a callback solves again
            cause = cause.__cause__ or cause.__context__
        if cause is not None:
            raise cause from None
        raise SimulationError(f"PETSc gave up: {str(error).splitlines()[0]}") from error


def weakly(method: Callable) -> Callable:
    """A callback for PETSc that does not keep the method's object alive. Python's garbage collector does not see what
    PETSc keeps: an object that PETSc calls, and that owns the caller, would stay for ever, with its level's mesh.
    """
    reference = WeakMethod(method)
    return lambda *arguments: reference()(*arguments)  # type: ignore[misc]
