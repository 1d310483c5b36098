"""What a time integrator offers: it predicts positions, weighs the potential beside the inertia, and gives velocities.

One step minimises 1/2 |x - x_hat|^2_M + weight (Psi + B + D - f.x). An integrator chooses x_hat and the weight from the
last states.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass(frozen=True, eq=False)
class State:
    """A state at the end of a step.

    Attributes
    ----------
    positions : (n, d) [m]
    velocity : (n, d) [m/s], in the same order of rows
    """

    positions: np.ndarray
    velocity: np.ndarray

    def rows(self, choose: Callable[[np.ndarray], np.ndarray]) -> "State":
        """The same state with other rows, as `LevelSpace.from_input` chooses them."""
        return State(choose(self.positions), choose(self.velocity))


Past = tuple[State, ...]
"""The last states, newest first: as many as the integrator uses, fewer at the beginning."""


class Integrator(Protocol):
    """An integrator with constant steps.

    An object of a user's own may take part where it has these four (`pdvol.march`). One object serves all levels, so it
    keeps nothing of a step.

    Attributes
    ----------
    states : how many past states it uses; it begins with fewer
    """

    states: int

    def predict(self, past: Past, dt: float) -> np.ndarray:
        """x_hat (n, d) [m] of a step of dt [s]."""

    def weight(self, past: Past, dt: float) -> float:
        """Factor [s^2] of the potential beside the inertia 1/2 |x - x_hat|^2_M."""

    def velocity(self, positions: np.ndarray, past: Past, dt: float) -> np.ndarray:
        """Velocities (n, d) [m/s] at the end of a step that led to `positions`."""


class ImplicitEuler:
    """Implicit Euler: x_hat = x^t + dt v^t, weight dt^2, v = (x^{t+1} - x^t) / dt. First order in dt, strongly damping.

    It is the integrator of all marches.
    """

    states = 1

    def predict(self, past: Past, dt: float) -> np.ndarray:
        """x^t + dt v^t, (n, d) [m]."""
        return past[0].positions + dt * past[0].velocity

    def weight(self, past: Past, dt: float) -> float:
        """dt^2 [s^2]."""
        return dt**2

    def velocity(self, positions: np.ndarray, past: Past, dt: float) -> np.ndarray:
        """The difference over the step, (n, d) [m/s]."""
        return (positions - past[0].positions) / dt


def advance(integrator: Integrator, past: Past, positions: np.ndarray, dt: float, joined: int = 1) -> Past:
    """The past after a step that led to `positions` (n, d), of so many steps of dt [s] joined to one; itself after a
    step at rest, joined 0. Steps that were joined are one of implicit Euler, from which the integrator starts anew.
    """
    if joined == 0:
        return past
    if joined > 1:
        integrator, past, dt = ImplicitEuler(), past[:1], joined * dt
    return (State(positions, integrator.velocity(positions, past, dt)), *past[: integrator.states - 1])


def past_of(
    integrator: Integrator,
    positions: Callable[[int], np.ndarray],
    velocity: np.ndarray,
    step: int,
    dt: float,
    joined: Callable[[int], int] = lambda step: 1,
) -> Past:
    """The past at the end of a stored step, to the last bit as it was in the run that stored it.

    Parameters
    ----------
    positions : step -> (n, d) [m]
    velocity : (n, d) [m/s] at step 0
    joined : step -> how many steps were joined to one there
    """
    solved: list[tuple[int, int]] = []  # velocities of the states used are themselves made of as many
    while step > 0 and len(solved) < 2 * integrator.states - 1:
        number = joined(step)
        solved += [(step, number)] * (number > 0)
        step -= 1
    past: Past = (State(positions(step), velocity),)
    for number, steps in reversed(solved):
        past = advance(integrator, past, positions(number), dt, steps)
    return past
