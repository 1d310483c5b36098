"""The smoothed Coulomb law of Li et al. 2020, section 5: friction forces grow to mu lambda at a slip of eps [m] and are
constant beyond, where lambda [N] is the normal force.
"""

import numpy as np


def f0(slip: np.ndarray, eps: float) -> np.ndarray:
    """Dissipation per unit of mu lambda [m] at a slip [m]; its derivative is f1."""
    inside = slip < eps
    return np.where(inside, slip**2 * (1.0 - slip / (3.0 * eps)) / eps + eps / 3.0, slip)


def f1_over(slip: np.ndarray, eps: float) -> np.ndarray:
    """f1(slip) / slip [1/m]; 2 / eps at zero slip."""
    return np.where(slip < eps, (2.0 - slip / eps) / eps, 1.0 / np.maximum(slip, eps))


def f1_slope(slip: np.ndarray, eps: float) -> np.ndarray:
    """d f1 / d slip [1/m]: never negative, so that friction Hessians are positive semi-definite as they are."""
    return np.where(slip < eps, 2.0 * (1.0 - slip / eps) / eps, 0.0)
