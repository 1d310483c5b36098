"""External loads, as densities: they mean the same on every mesh."""

import ufl
from ufl.core.expr import Expr


def body_force(density: Expr, acceleration: Expr, v: Expr, domain: ufl.Mesh) -> ufl.Form:
    """Linear form of the force [N] of a uniform acceleration on a body of the given density.

    Parameters
    ----------
    density : [kg/m^d], UFL
    acceleration : (d,) [m/s^2], UFL
    v : test function of a vector P1 space
    domain : mesh of that space
    """
    dx = ufl.Measure("dx", domain=domain)
    return density * ufl.inner(acceleration, v) * dx
