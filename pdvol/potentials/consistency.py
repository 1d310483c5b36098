"""The penalty that holds a level to the positions of the level below it (paper, equation 4):
E = k |x - target|^2_M, k = w / dt^2.

Quadratic, so its Hessian 2 k M is exact and needs no filter. k belongs to the scene's time step. Both halves of a step
that is cut have the same k; the first one's target is the coarser level half-way.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions, Term


@dataclass(frozen=True, eq=False)
class Guide:
    """Where a level is held, and how firmly.

    Attributes
    ----------
    stiffness : k [1/s^2]
    target : time [s] -> positions (n, d) [m], in the input's order, the same on every rank; its calls are collective
    """

    stiffness: float
    target: Callable[[float], np.ndarray]


class Consistency(Term):
    """The penalty towards a guide's positions at the end of the step.

    Parameters
    ----------
    mass : (n_owned, d) [kg]
    """

    name = "consistency"

    def __init__(self, space: LevelSpace, mass: np.ndarray, guide: Guide):
        self.space, self.guide = space, guide
        self._weight = guide.stiffness * mass
        self._target = np.zeros_like(mass)

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self._target = self.space.from_input(self.guide.target(t1))

    def value(self, x: Positions) -> float:
        away = x.owned - self._target
        return self.space.reduce(float(np.vdot(away, self._weight * away)))

    def gradient(self, x: Positions) -> np.ndarray:
        return 2.0 * self._weight * (x.owned - self._target)

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        into.add_masses(2.0 * weight * self._weight)
