"""Pairs that ipctk hands out one by one, as arrays."""

from operator import attrgetter

import numpy as np


def column(pairs: list, name: str, kind: type = float) -> np.ndarray:
    """(k,) one attribute of all pairs."""
    return np.fromiter(map(attrgetter(name), pairs), dtype=kind, count=len(pairs))


def columns(pairs: list, *names: str) -> np.ndarray:
    """(k, names) several."""
    return np.column_stack([column(pairs, name) for name in names])
