"""The edge length for a wanted number of vertices.

`edge_length` predicts it for nearly equilateral simplices; `mesh_of_target_size` corrects it by meshing a few times.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.meshing.cpu_budget import BudgetSpent, ProcessStopped, check_budget
from pdvol.stages import say

ACCEPTED_DEVIATION = 0.1
"""Relative deviation of the number of vertices from the target at which the search ends."""
CLOSEST_FACTOR = 2.0
"""Largest ratio of a count and its target at which the closest mesh is taken in the end: targets are wishes, and levels
of a hierarchy are mostly further apart than that.
"""
MAX_ATTEMPTS = 6
"""Number of meshes after which the search ends with the closest."""
FINER = 0.94
"""Factor on the edge length after a mesh that is not valid: about 15 % more vertices, which still suits the target."""
LONGER, FEWER = 1.5, 0.9
"""A search ends where edges longer by the first factor leave more than the second one of too many vertices: no longer
edges give the target. Elsewhere they leave less than half.
"""
MORE_VERTICES = 2
"""Factor on a target for which no mesh is valid: edges a quarter shorter, which holes and thin walls often need."""

BASE_CPU_SECONDS = 12.0
"""Processor time [s] that one call of a mesher may use, whatever the target: 8 times what a coarse mesh takes."""
CPU_SECONDS_PER_VERTEX = 0.02
"""Processor time [s] that one call of a mesher may use per vertex of the target: two to ten times what is measured."""

History = list[tuple[float, float]]
"""Per mesh made: logarithms of its scale, and of its number of vertices relative to the target."""


class UnreachableCount(MeshError):
    """No mesh has about `target` vertices; the closest one has `closest`, or may have. Whether one of these comes out
    when it is asked for is not known yet.
    """

    def __init__(self, message: str, target: int, closest: int):
        super().__init__(message)
        self.target, self.closest = target, closest


@dataclass(frozen=True, eq=False)
class SizedMesh:
    """A mesh that was made from an input: points (n, d) float64 [m], cells (m, d + 1) int64, and the `places` (n, d)
    [m] of the input that the points stand for: where they were before the mesh got the input's volume.
    """

    points: np.ndarray
    cells: np.ndarray
    places: np.ndarray

    def placed(self, centre: np.ndarray, size: float) -> "SizedMesh":
        """The mesh in coordinates [m] of which its own are multiples of `size` [m] about `centre` (d,) [m]."""
        return SizedMesh(centre + size * self.points, self.cells, centre + size * self.places)


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

    def excess(log_h: float) -> float:
        return np.log(expected_vertices(np.exp(log_h), content, boundary, dim)[1] / target)

    low, high = np.log(size) - 12.0, np.log(size) + 2.0
    while excess(high) > 0:  # long thin shapes: the boundary alone has more
        high += 2.0
    from scipy.optimize import brentq  # takes as long to load as a cached mesh to read

    return float(np.exp(brentq(excess, low, high)))


def mesh_of_target_size(
    make: Callable[[float, int], SizedMesh], target: int, name: str, start: float, dim: int
) -> SizedMesh:
    """Call `make(scale, failures)` with edge-length factors until the number of points suits the target.

    `make` raises InputError for an invalid mesh; the next call then gets a `failures` that is larger by one.
    UnreachableCount is raised where no mesh came within `CLOSEST_FACTOR` of the target, or none was valid: its message
    has the last failure. A mesher that ran out of processor time is not called again; one that crashed is. MeshError is
    raised where the processor time of the command is used up.
    """
    best: tuple[float, SizedMesh] | None = None
    reason, failures = "", 0
    scale, history = start, History()
    for tried in range(1, MAX_ATTEMPTS + 1):
        check_budget(name)
        say(f"try {tried} of at most {MAX_ATTEMPTS}")
        try:
            made = make(scale, failures)
        except ProcessStopped as error:
            message = f"{name}: no mesh of about {target} vertices: {error}"
            if isinstance(error, BudgetSpent):
                raise MeshError(f"{message}; ask for another number of vertices or clean the surface") from None
            raise UnreachableCount(message, target, MORE_VERTICES * target) from None
        except InputError as error:
            reason, failures = str(error), failures + 1
            history.clear()  # the next mesh is made differently: counts do not compare
            scale *= FINER
            continue
        off = np.log(len(made.points) / target)
        history.append((np.log(scale), off))
        if best is None or abs(off) < best[0]:
            best = (abs(off), made)
        if abs(len(made.points) / target - 1.0) <= ACCEPTED_DEVIATION:
            say(f"{len(made.points):,} vertices, {'1 try' if tried == 1 else f'{tried} tries'}")
            return made
        if len(history) > 1 and off > 0:
            longer, fewer = np.subtract(history[-1], history[-2])
            if longer >= np.log(LONGER) and fewer > np.log(FEWER):
                break
        scale = float(np.exp(_next_log_scale(history, dim)))
    if best is None:
        raise UnreachableCount(
            f"{name}: no valid mesh of about {target} vertices came out ({reason})", target, MORE_VERTICES * target
        )
    n = len(best[1].points)
    if best[0] <= np.log(CLOSEST_FACTOR):
        say(f"{n:,} vertices, the closest to {target:,} in {tried} tries")
        return best[1]
    raise UnreachableCount(f"{name}: {target} vertices cannot be had, the closest mesh has {n}", target, n)


def _next_log_scale(history: History, dim: int) -> float:
    """Next log scale: between the nearest counts on either side of the target, else along the expected slope."""
    over = [p for p in history if p[1] > 0]
    under = [p for p in history if p[1] <= 0]
    if over and under:
        # The last change of side: counts jump a little, and the same scale must not be tried again.
        a, fa = max(over)
        b, fb = min((p for p in under if p[0] > a), default=max(under, key=lambda p: p[1]))
        return a + np.clip(fa / (fa - fb), 0.15, 0.85) * (b - a)
    # A little below the dimension: part of the vertices lie on the boundary.
    slope = dim - 0.4
    if len(history) > 1 and history[-1][0] != history[-2][0]:
        slope = np.clip(-(history[-1][1] - history[-2][1]) / (history[-1][0] - history[-2][0]), 1.0, dim)
    x, f = history[-1]
    return x + float(np.clip(f / slope, -1.2, 1.2))
