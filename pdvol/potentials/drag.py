r"""Drag of a flow on surfaces, as a dissipation potential.

The force on a vertex of area a is a rho c/2 |w| w with w = u - (x - x~) / h, the flow's velocity past it (x~ and h are
start and duration of rates): minus the derivative of

    D(x) = sum of a rho c/2 (h/3) |w|^3

by x at fixed u, which is convex: nothing is lagged but u, and rest areas stand for current ones. It is implicit: no
step, however long, accelerates a vertex beyond the flow.

u is taken at the step's end t1, at its start positions x_t where rates are means over the step, of first order.
Otherwise x~ is where a vertex is at t1 - h, to second order, and u is taken on the straight line from x_t through x~.
"""

from collections.abc import Callable

import numpy as np

from pdvol.geometry.level_mesh import boundary_areas
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions, Rates, Term


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
        self._start, self._duration = x_t.owned[self.vertices], t1 - t0
        self._end, self._dt = t1, t1 - t0
        self._flow = self._velocity(self._start, t1)

    def set_rates(self, rates: Rates) -> None:
        now, self._duration = self._start, rates.duration
        self._start = rates.start(now, lambda e: e.x.owned[self.vertices])
        if rates.earlier:
            ahead = now + (self._start - now) * (self._dt / (self._dt - self._duration))
            self._flow = self._velocity(ahead, self._end)

    def _past(self, x: Positions) -> tuple[np.ndarray, np.ndarray]:
        w = self._flow - (x.owned[self.vertices] - self._start) / self._duration
        return w, np.linalg.norm(w, axis=1)

    def value(self, x: Positions) -> float:
        _, speed = self._past(x)
        return self.space.reduce(float(self._strength @ speed**3) * self._duration / 3.0)

    def gradient(self, x: Positions) -> np.ndarray:
        w, speed = self._past(x)
        out = np.zeros_like(x.owned)
        out[self.vertices] = -(self._strength * speed)[:, None] * w
        return out

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        w, speed = self._past(x)
        along = w / np.maximum(speed, 1e-300)[:, None]
        blocks = speed[:, None, None] * (np.eye(self.space.dim) + along[:, :, None] * along[:, None, :])
        into.add_diagonal(self.vertices, (weight / self._duration * self._strength)[:, None, None] * blocks)
