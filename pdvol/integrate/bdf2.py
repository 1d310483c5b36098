"""BDF2, the second backward differentiation formula: second order in dt, far less damping than implicit Euler.

    v^{t+1} = (3 x^{t+1} - 4 x^t + x^{t-1}) / (2 dt),    M (3 v^{t+1} - 4 v^t + v^{t-1}) / (2 dt) = f(x^{t+1})

With h = 2 dt / 3 that minimises 1/2 |x - x_hat|^2_M + h^2 E(x) for x_hat = (4 x^t - x^{t-1}) / 3 + h (4 v^t - v^{t-1})
/ 3. The first step is one of implicit Euler, which leaves the order at two. So is the first one after a jump. A step
that had to be cut is solved in parts by implicit Euler. Friction, drag and damping take the same velocities. Source:
Hairer, Wanner, Solving Ordinary Differential Equations II, section V.1.
"""

import numpy as np

from pdvol.integrate.integrator import ImplicitEuler, Past

_FIRST = ImplicitEuler()


class BDF2:
    """The integrator `bdf2`."""

    states = 2

    def predict(self, past: Past, dt: float) -> np.ndarray:
        """x_hat as above, (n, d) [m]."""
        if len(past) < self.states:
            return _FIRST.predict(past, dt)
        now, before = past
        h = 2.0 * dt / 3.0
        return (4.0 * now.positions - before.positions) / 3.0 + h * (4.0 * now.velocity - before.velocity) / 3.0

    def weight(self, past: Past, dt: float) -> float:
        """(2 dt / 3)^2 [s^2]."""
        return _FIRST.weight(past, dt) if len(past) < self.states else (2.0 * dt / 3.0) ** 2

    def velocity(self, positions: np.ndarray, past: Past, dt: float) -> np.ndarray:
        """The second-order backward difference, (n, d) [m/s]."""
        if len(past) < self.states:
            return _FIRST.velocity(positions, past, dt)
        now, before = past
        return (3.0 * positions - 4.0 * now.positions + before.positions) / (2.0 * dt)
