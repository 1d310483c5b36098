r"""Drag of a flow on surfaces, as a dissipation potential.

The force on a vertex of area a is a rho c/2 |w| w with w = u - (x - x_t) / dt, the flow's velocity past it: minus the
derivative of

    D(x) = sum of a rho c/2 (dt/3) |w|^3

by x at fixed u, which is convex: nothing is lagged but u, taken at the step's start positions and end time, and rest
areas stand for current ones. It is implicit: no step, however long, accelerates a vertex beyond the flow.
"""

from collections.abc import Callable

import numpy as np

from pdvol.geometry.level_mesh import boundary_areas
from pdvol.levels.space import LevelSpace
from pdvol.parallel import reduce
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions, Term


class Drag(Term):
    """One flow's drag.

    Parameters
    ----------
    space : LevelSpace
    felt : (n,) bool, points of the level, in the input's order, on which it may act; it does not act on those inside
        bodies
    velocity : (positions (k, d), time) -> (k, d) [m/s]
    strength : density times drag coefficient / 2 [kg/m^3]
    """

    name = "drag"

    def __init__(
        self, space: LevelSpace, felt: np.ndarray, velocity: Callable[[np.ndarray, float], np.ndarray], strength: float
    ):
        self.space, self._velocity = space, velocity
        areas = np.where(felt, boundary_areas(space.mesh), 0.0)[space.owned_points]
        self.vertices = np.flatnonzero(areas > 0)
        self._strength = strength * areas[self.vertices]

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self._start, self._dt = x_t.owned[self.vertices], t1 - t0
        self._flow = self._velocity(self._start, t1)

    def _past(self, x: Positions) -> tuple[np.ndarray, np.ndarray]:
        w = self._flow - (x.owned[self.vertices] - self._start) / self._dt
        return w, np.linalg.norm(w, axis=1)

    def value(self, x: Positions) -> float:
        _, speed = self._past(x)
        return reduce(self.space.comm, float(self._strength @ speed**3) * self._dt / 3.0)

    def gradient(self, x: Positions) -> np.ndarray:
        w, speed = self._past(x)
        out = np.zeros_like(x.owned)
        out[self.vertices] = -(self._strength * speed)[:, None] * w
        return out

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        w, speed = self._past(x)
        along = w / np.maximum(speed, 1e-300)[:, None]
        blocks = speed[:, None, None] * (np.eye(self.space.dim) + along[:, :, None] * along[:, None, :])
        into.add_diagonal(self.vertices, (weight / self._dt * self._strength)[:, None, None] * blocks)
