"""Time integrators. An integrator predicts positions, weighs the potential beside the inertia, and gives velocities.

One step minimises 1/2 |x - x_hat|^2_M + weight (Psi + B + D - f.x). An integrator chooses x_hat and the weight from the
last states.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pdvol.levels.script import Mover
from pdvol.levels.space import LevelSpace
from pdvol.potentials.potential import Earlier, Positions, Rates


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
    """An integrator with constant steps, whose prediction and velocity are linear in the states.

    An object of a user's own may take part where it has these four (`pdvol.march`). One object serves all levels, so it
    keeps nothing of a step. What else depends on the integrator follows from these: a finer level's prediction
    (`marches.led`), and the velocities of friction, drag and damping (`differences`).

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
    """Implicit Euler: x_hat = x^t + dt v^t, weight dt^2, v = (x^{t+1} - x^t) / dt. First order, strongly damping."""

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


class BDF2:
    """BDF2, the second backward differentiation formula: second order in dt, far less damping than implicit Euler.

        v^{t+1} = (3 x^{t+1} - 4 x^t + x^{t-1}) / (2 dt),    M (3 v^{t+1} - 4 v^t + v^{t-1}) / (2 dt) = f(x^{t+1})

    With h = 2 dt / 3 that minimises 1/2 |x - x_hat|^2_M + h^2 E(x) for x_hat = (4 x^t - x^{t-1}) / 3 + h (4 v^t -
    v^{t-1}) / 3. The first step is one of implicit Euler, which leaves the order at two. So is the first one after a
    jump. A step that had to be cut is solved in parts by implicit Euler. A blow in such a step changes v at once. The
    next step of BDF2 would take that for the beginning of a lasting acceleration, and half of the blow would count once
    more. So the next one is a step of implicit Euler, too. Friction, drag and damping take the same velocities. Source:
    Hairer, Wanner, Solving Ordinary Differential Equations II, section V.1.
    """

    states = 2

    def predict(self, past: Past, dt: float) -> np.ndarray:
        """x_hat as above, (n, d) [m]."""
        if len(past) < self.states:
            return ImplicitEuler().predict(past, dt)
        now, before = past
        h = 2.0 * dt / 3.0
        return (4.0 * now.positions - before.positions) / 3.0 + h * (4.0 * now.velocity - before.velocity) / 3.0

    def weight(self, past: Past, dt: float) -> float:
        """(2 dt / 3)^2 [s^2]."""
        return ImplicitEuler().weight(past, dt) if len(past) < self.states else (2.0 * dt / 3.0) ** 2

    def velocity(self, positions: np.ndarray, past: Past, dt: float) -> np.ndarray:
        """The second-order backward difference, (n, d) [m/s]."""
        if len(past) < self.states:
            return ImplicitEuler().velocity(positions, past, dt)
        now, before = past
        return (3.0 * positions - 4.0 * now.positions + before.positions) / (2.0 * dt)


def advance(
    integrator: Integrator, past: Past, positions: np.ndarray, dt: float, anew: bool = False, struck: bool = False
) -> Past:
    """The past after a step of dt [s] that led to `positions` (n, d). One in which contact `struck` (`Stepper`) is a
    step of implicit Euler, from which the integrator starts anew. It also starts anew where the next step begins
    `anew`, as no difference is taken over a jump (`LevelModel.begins_anew`).
    """
    if struck:
        integrator, past = ImplicitEuler(), past[:1]
    past = (State(positions, integrator.velocity(positions, past, dt)), *past[: integrator.states - 1])
    return past[:1] if anew else past


def differences(integrator: Integrator, states: int, dt: float) -> tuple[float, tuple[float, ...]]:
    """How an integrator with so many past states takes velocities: h [s] and the weights a_1, a_2, ... in

        v = (x - x~) / h,    x~ = x^t + a_1 (x^{t-1} - x^t) + a_2 (x^{t-2} - x^t) + ...

    They are what `velocity` makes of single displacements by dt, as it is linear. Where it uses velocities of the past,
    which other quantities than positions do not have, they are those of the mean over the step: dt and no weights.
    """
    everywhere = lambda value: np.full((1, 1), value)

    def speed(end: float, moved: int = -1, before: float = 0.0) -> float:
        past = tuple(State(everywhere(dt * (k == moved)), everywhere(before)) for k in range(states))
        return float(integrator.velocity(everywhere(end), past, dt)[0, 0])

    unit = speed(dt)
    if unit <= 0.0 or speed(0.0, before=1.0) != 0.0:
        return dt, ()
    return dt / unit, tuple(-speed(0.0, k) / unit for k in range(1, states))


def rates_of(
    integrator: Integrator, past: Past, space: LevelSpace, time: float, dt: float, lags: Sequence[Mapping[Mover, float]]
) -> Rates | None:
    """How rates of change follow from the end of a step of dt [s] from the past at a time [s]; None where they are
    means over it. Obstacles were late by `lags` [s] at the past's states before the first one.
    """
    duration, weights = differences(integrator, len(past), dt)
    earlier = tuple(
        Earlier(weight, Positions(space, space.from_input(state.positions)), time - number * dt, late)
        for number, (weight, state, late) in enumerate(zip(weights, past[1:], lags, strict=False), start=1)
    )
    return Rates(duration, earlier) if earlier or duration != dt else None


def past_of(
    integrator: Integrator,
    positions: Callable[[int], np.ndarray],
    velocity: np.ndarray,
    step: int,
    dt: float,
    record: Callable[[int], Mapping] = lambda step: {},
    anew: Callable[[int], bool] = lambda step: False,
) -> Past:
    """The past at the end of a stored step, to the last bit as it was in the run that stored it.

    Parameters
    ----------
    positions : step -> (n, d) [m]
    velocity : (n, d) [m/s] at step 0
    anew : step -> whether the next step begins anew
    record : step -> its record in the log, which has whether contact struck
    """
    first = max(0, step - 2 * integrator.states + 1)  # velocities of the states used are made of as many
    past: Past = (State(positions(first), velocity),)
    for number in range(first + 1, step + 1):
        past = advance(integrator, past, positions(number), dt, anew(number), bool(record(number).get("struck")))
    return past
