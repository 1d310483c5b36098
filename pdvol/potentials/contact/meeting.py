"""Which objects meet, as pairs of their numbers, gathered from all ranks."""

import numpy as np
from mpi4py import MPI


def different_pairs(one: np.ndarray, other: np.ndarray, comm: MPI.Comm) -> set[tuple[int, int]]:
    """The pairs of different numbers in two arrays (k,), of all ranks together. Collective."""
    mine = {(int(a), int(b)) for a, b in np.unique(np.stack([one, other]), axis=1).T if a != b}
    return set().union(*comm.allgather(mine))
