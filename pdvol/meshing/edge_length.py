"""From a number of vertices to an edge length: what a mesh of nearly equilateral simplices has, and how to home in on a
count.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from pdvol.errors import InputError, MeshError

AIM, ALLOWED = 0.15, 0.25
"""A count within `AIM` of the target ends the search; within `ALLOWED` it is accepted once `PATIENCE` tries are used.
"""
TRIES, PATIENCE = 10, 4


@dataclass(frozen=True, eq=False)
class Sized:
    """A mesh and what led to it.

    Attributes
    ----------
    points : (n, d) float64 [m]
    cells : (m, d + 1) int64
    scale : float
        Edge length asked of the mesher over the one `edge_length` predicts.
    """

    points: np.ndarray
    cells: np.ndarray
    scale: float


def expected_vertices(h: float, content: float, boundary: float, dim: int) -> tuple[float, float]:
    """Vertices (on the boundary, in all) of a mesh of edge length h [m] of a shape of given content [m^dim] and
    boundary [m^(dim-1)].

    A vertex holds sqrt(3)/2 h^2 of a triangle mesh and about 0.7 h^3 of a tetrahedral one (six equilateral tetrahedra,
    which do not quite fill space); the layer of h/2 along the boundary belongs to the boundary's vertices.
    """
    flat = np.sqrt(3.0) / 2.0
    on, each = (boundary / h, flat * h**2) if dim == 2 else (boundary / (flat * h**2), 0.7 * h**3)
    return on, on + max(content - 0.5 * h * boundary, 0.0) / each


def edge_length(target: int, content: float, boundary: float, dim: int) -> float:
    """Edge length [m] at which `expected_vertices` gives `target`."""
    size = content ** (1.0 / dim)

    def excess(log_h):
        return np.log(expected_vertices(np.exp(log_h), content, boundary, dim)[1] / target)

    low, high = np.log(size) - 12.0, np.log(size) + 2.0
    while excess(high) > 0:  # long thin shapes: the boundary alone has more
        high += 2.0
    return float(np.exp(brentq(excess, low, high)))


def home_in(
    make: Callable[[float, int], tuple[np.ndarray, np.ndarray]], target: int, name: str, start: float, dim: int
) -> Sized:
    """Call `make(scale, failures)` with edge-length factors until the number of points suits the target.

    `make` raises InputError for a mesh that is no good; the next call is then told of one failure more.

    Raises
    ------
    MeshError
        No mesh came within `ALLOWED` of the target: the closest count, or the last failure, is stated.
    """
    best, reason, failures = None, "", 0
    scale, history = start, []
    for tried in range(1, TRIES + 1):
        try:
            points, cells = make(scale, failures)
        except InputError as error:
            reason, failures = str(error), failures + 1
            history.clear()  # the next mesh is made differently: counts do not compare
            scale *= 0.93
            continue
        off = np.log(len(points) / target)
        history.append((np.log(scale), off))
        if best is None or abs(off) < best[0]:
            best = (abs(off), Sized(points, cells, scale))
        share = abs(len(best[1].points) / target - 1.0)
        if share <= AIM or (share <= ALLOWED and tried >= PATIENCE):
            return best[1]
        if _saturated(history):
            break
        scale = float(np.exp(_next(history, dim)))
    if best is None:
        raise MeshError(
            f"{name}: no valid mesh of about {target} vertices came out ({reason}); clean the surface or ask for more"
            " vertices"
        )
    n = len(best[1].points)
    if abs(n / target - 1.0) <= ALLOWED:
        return best[1]
    raise MeshError(f"{name}: {target} vertices cannot be had, the closest mesh has {n}; ask for about {n} instead")


def _saturated(history) -> bool:
    """Whether a much longer edge hardly lowered a count that is too high: the shape's own features then set it, at
    growing cost.
    """
    last = history[-3:]
    if len(last) < 3 or min(f for _, f in last) <= np.log(1.0 + ALLOWED):
        return False
    (a, fa), (b, fb) = last[0], last[-1]
    return b - a > 0.4 and fa - fb < 0.15 * (b - a)


def _next(history, dim: int) -> float:
    """Next log scale: between the nearest counts on either side of the target, else along the expected slope."""
    over = [p for p in history if p[1] > 0]
    under = [p for p in history if p[1] <= 0]
    if over and under:
        (a, fa), (b, fb) = min(over, key=lambda p: p[1]), max(under, key=lambda p: p[1])
        share = np.clip(fa / (fa - fb), 0.15, 0.85)
        return a + share * (b - a)
    # A little below the dimension: part of the vertices lie on the boundary.
    slope = dim - 0.4
    if len(history) > 1 and history[-1][0] != history[-2][0]:
        slope = np.clip(-(history[-1][1] - history[-2][1]) / (history[-1][0] - history[-2][0]), 0.5, dim)
    x, f = history[-1]
    return x + float(np.clip(f / slope, -1.2, 1.2))
