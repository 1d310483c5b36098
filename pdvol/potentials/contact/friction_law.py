"""The smoothed Coulomb law of Li et al. 2020, section 5: forces grow to mu lambda within a slip of eps, then stay."""

import numpy as np


def f0(slip: np.ndarray, eps: float) -> np.ndarray:
    """Dissipation per unit of mu lambda [m] at a slip [m]; its derivative is f1."""
    inside = slip < eps
    return np.where(inside, slip**2 * (1.0 - slip / (3.0 * eps)) / eps + eps / 3.0, slip)


def f1_over(slip: np.ndarray, eps: float) -> np.ndarray:
    """f1(slip) / slip [1/m], finite at zero slip."""
    return np.where(slip < eps, (2.0 - slip / eps) / eps, 1.0 / np.maximum(slip, eps))


def f1_slope(slip: np.ndarray, eps: float) -> np.ndarray:
    """d f1 / d slip [1/m]: never negative, so that friction Hessians are positive semi-definite as they are."""
    return np.where(slip < eps, 2.0 * (1.0 - slip / eps) / eps, 0.0)


def stiffness(slip: np.ndarray, eps: float, majorise: bool) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness across and along the slip [1/m], per unit of mu lambda.

    With `majorise` that along the slip is the one across: f0 is concave in slip^2, so this quadratic model lies above
    it everywhere, and Newton does not jump to and fro across the kink between sticking and sliding.
    """
    across = f1_over(slip, eps)
    return across, across if majorise else f1_slope(slip, eps)
