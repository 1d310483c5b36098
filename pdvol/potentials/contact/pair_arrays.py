"""Attributes of ipctk's lists of pairs, as arrays."""

from operator import attrgetter

import numpy as np


def column(pairs: list, name: str, kind: type = float) -> np.ndarray:
    """(k,) one attribute of k pairs."""
    return np.fromiter(map(attrgetter(name), pairs), dtype=kind, count=len(pairs))


def columns(pairs: list, *names: str) -> np.ndarray:
    """(k, names) several attributes of k pairs, as floats."""
    return np.column_stack([column(pairs, name) for name in names])
