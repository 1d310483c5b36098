"""Implicit Euler: x_hat = x^t + dt v^t, weight dt^2, v = (x^{t+1} - x^t) / dt. First order in dt, strongly damping."""

import numpy as np

from pdvol.integrate.integrator import Past


class ImplicitEuler:
    """The integrator of all marches."""

    name = "implicit_euler"
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
