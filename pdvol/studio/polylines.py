"""Polylines as directed edges."""

import numpy as np


def closed_loops(edges: np.ndarray) -> list[list[int]]:
    """Closed chains of directed edges (m, 2), as lists of vertices; open chains are left out."""
    following = {int(a): int(b) for a, b in edges}
    loops, seen = [], set()
    for start in following:
        chain, at = [], start
        while at in following and at not in seen:
            seen.add(at)
            chain.append(at)
            at = following[at]
        if len(chain) > 2 and at == start:
            loops.append(chain)
    return loops
