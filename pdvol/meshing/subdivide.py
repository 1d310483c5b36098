"""Splits the longest edges of a surface whose triangles are too large for a level. The shape stays as it is."""

import heapq

import numpy as np

from pdvol.meshes import Surface

Edge = tuple[int, int]


def split_longest_edges(surface: Surface, count: int) -> Surface:
    """The closed surface with `count` vertices: its longest edge is halved, with the two triangles at it, until it has
    so many. Unchanged where it has them already.

    Edges of one length are taken in the order of their vertices, so that the result is always the same.
    """
    if len(surface.vertices) >= count:
        return surface
    points = [np.asarray(p, dtype=np.float64) for p in surface.vertices]
    triangles: dict[int, tuple[int, int, int]] = {}
    beside: dict[Edge, set[int]] = {}
    queue: list[tuple[float, Edge]] = []
    # lengths are compared to nine digits: those that differ by round-off alone are equal
    digits = 9 - int(np.floor(np.log10(np.ptp(surface.vertices, axis=0).max())))

    def add(number: int, corners: tuple[int, int, int]) -> None:
        triangles[number] = corners
        for edge in _edges(corners):
            if edge not in beside:
                length = float(np.linalg.norm(points[edge[0]] - points[edge[1]]))
                heapq.heappush(queue, (-round(length, digits), edge))
            beside.setdefault(edge, set()).add(number)

    for number, (a, b, c) in enumerate(surface.triangles.tolist()):
        add(number, (a, b, c))
    following = len(triangles)
    while len(points) < count:
        _, edge = heapq.heappop(queue)
        middle = len(points)
        points.append(0.5 * (points[edge[0]] + points[edge[1]]))
        for number in sorted(beside[edge]):
            corners = triangles.pop(number)
            for other in _edges(corners):
                beside[other].discard(number)
            k = next(k for k in range(3) if _opposite(corners, k) == edge)
            apex, first, second = corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]
            add(following, (apex, first, middle))
            add(following + 1, (apex, middle, second))
            following += 2
    return Surface(np.array(points), np.array([triangles[k] for k in sorted(triangles)], dtype=np.int32))


def _opposite(corners: tuple[int, int, int], k: int) -> Edge:
    """The edge opposite to corner k, its smaller vertex first."""
    a, b = corners[(k + 1) % 3], corners[(k + 2) % 3]
    return (a, b) if a < b else (b, a)


def _edges(corners: tuple[int, int, int]) -> list[Edge]:
    return [_opposite(corners, k) for k in range(3)]
