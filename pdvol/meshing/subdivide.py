"""Splits the longest edges of a surface whose triangles are too large for a level. The shape stays as it is."""

import heapq
from itertools import count as counted

import numpy as np

from pdvol.meshes import Surface

Edge = tuple[int, int]
"""Its smaller vertex first."""


def split_longest_edges(surface: Surface, count: int) -> Surface:
    """The closed surface with `count` vertices: its longest edge is halved, with the two triangles at it, until it has
    so many. Unchanged where it has them already.

    Edges of one length are taken in the order of their vertices, so that the result is always the same.
    """
    if len(surface.vertices) >= count:
        return surface
    points = [np.asarray(p, dtype=np.float64) for p in surface.vertices]
    triangles: dict[int, tuple[int, ...]] = {}
    beside: dict[Edge, set[int]] = {}
    queue, numbers = list[tuple[float, Edge]](), counted()
    # lengths are compared to nine digits: those that differ by round-off alone are equal
    digits = 9 - int(np.floor(np.log10(np.ptp(surface.vertices, axis=0).max())))

    def add(corners: tuple[int, ...]) -> None:
        number = next(numbers)
        triangles[number] = corners
        for edge in _edges(corners):
            if edge not in beside:
                length = float(np.linalg.norm(points[edge[0]] - points[edge[1]]))
                heapq.heappush(queue, (-round(length, digits), edge))
            beside.setdefault(edge, set()).add(number)

    for corners in surface.triangles.tolist():
        add(tuple(corners))
    while len(points) < count:
        _, edge = heapq.heappop(queue)
        middle = len(points)
        points.append(0.5 * (points[edge[0]] + points[edge[1]]))
        for number in sorted(beside[edge]):
            corners = triangles.pop(number)
            for other in _edges(corners):
                beside[other].discard(number)
            k = _edges(corners).index(edge)
            apex, first, second = *corners[k:], *corners[:k]
            add((apex, first, middle))
            add((apex, middle, second))
    return Surface(np.array(points), np.array([triangles[k] for k in sorted(triangles)], dtype=np.int32))


def _edges(corners: tuple[int, ...]) -> list[Edge]:
    """Those opposite to each corner."""
    a, b, c = corners
    return [(min(pair), max(pair)) for pair in ((b, c), (c, a), (a, b))]
