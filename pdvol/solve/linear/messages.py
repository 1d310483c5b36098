"""MPI for compiled loops, which call it in each iteration: through Python a message takes 5 to 40 us longer."""

import ctypes
import sys
from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI

from pdvol.compiled import ffi, pointer


@cache
def library() -> ctypes.CDLL:
    """mpi4py's own module: its functions of MPI are those of the library that it uses."""
    return ctypes.CDLL(MPI.__file__)


def _handle(thing: Any) -> Any:
    """A handle of MPI as C has it: a pointer, or an int in the place of one."""
    number = int.from_bytes(ctypes.string_at(MPI._addressof(thing), MPI._sizeof(thing)), sys.byteorder)
    return ffi.cast("void *", number)


class Exchange:
    """What ranks send each other of a vector.

    Attributes
    ----------
    compiled : ranks_t *
        The same for ever.
    """

    def __init__(self, comm: MPI.Comm):
        self.compiled: Any = ffi.new("ranks_t *")
        self.compiled.comm, self.compiled.numbers, self.compiled.sum = map(_handle, (comm, MPI.DOUBLE, MPI.SUM))
        self.compiled.in_place = ffi.cast("void *", int(MPI.IN_PLACE))
        fields = dict(ffi.typeof("ranks_t").fields)
        for kind, name in (("all_reduce", "MPI_Allreduce"), ("all_to_all", "MPI_Alltoallv")):
            address = ctypes.cast(getattr(library(), name), ctypes.c_void_p).value
            setattr(self.compiled, kind, ffi.cast(fields[kind].type, address))
        self._arrays: dict[str, np.ndarray] = {}

    def connect(self, d: int, rows: np.ndarray, counts: np.ndarray, theirs: np.ndarray) -> None:
        """For each rank: counts[rank] of `rows`, which go to it, and how many come from it; `d` numbers each."""
        ours, theirs = d * counts, d * theirs
        indices = {"row": rows, "counts": ours, "their_counts": theirs}
        indices |= {"starts": _firsts(ours), "their_starts": _firsts(theirs)}
        numbers = {"sent": np.empty(d * len(rows)), "received": np.empty(int(theirs.sum()))}
        self.compiled.rows = len(rows)
        for name, array in indices.items():
            setattr(self.compiled, name, pointer(array, "int32_t"))
        for name, array in numbers.items():
            setattr(self.compiled, name, pointer(array))
        self._arrays = indices | numbers


def exchanged(comm: MPI.Comm, numbers: np.ndarray, counts: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """What comes from the others, theirs[rank] numbers from each, where each gets counts[rank] of `numbers` (flat or
    not). Collective.
    """
    came = np.empty(int(theirs.sum()), numbers.dtype)
    comm.Alltoallv([numbers, (counts, _firsts(counts))], [came, (theirs, _firsts(theirs))])
    return came


def _firsts(counts: np.ndarray) -> np.ndarray:
    """Where groups of so many numbers begin."""
    return np.cumsum(counts, dtype=np.int32) - counts
