"""The barrier's law in the gap: kappa dhat g(s) per area, g(s) = -(s - 1)^2 ln s, s = (gap / dhat)^2 (Li et al. 2023,
physical units).
"""

import numpy as np


def energy(s: np.ndarray, dhat: float, kappa: float) -> np.ndarray:
    """Energy per area [J/m^2] at s in (0, 1)."""
    return -kappa * dhat * (s - 1.0) ** 2 * np.log(s)


def pressure(s: np.ndarray, dhat: float, kappa: float) -> np.ndarray:
    """Contact pressure [Pa]: minus the energy's derivative by the gap."""
    return 2.0 * kappa * np.sqrt(s) * (s - 1.0) * (2.0 * np.log(s) + (s - 1.0) / s)


def curvature(s: np.ndarray, dhat: float, kappa: float) -> np.ndarray:
    """Second derivative by the gap [Pa/m]; positive for s < 1, zero beyond."""
    s = np.minimum(s, 1.0)
    g1 = -(s - 1.0) * (2.0 * np.log(s) + (s - 1.0) / s)
    g2 = -(2.0 * np.log(s) + 4.0 * (s - 1.0) / s - (s - 1.0) ** 2 / s**2)
    return kappa / dhat * (4.0 * s * g2 + 2.0 * g1)
