"""External loads, as densities: they mean the same on every mesh."""

import ufl


def body_force(density, acceleration, v, domain):
    """Linear form of the force [N] of a uniform acceleration on a body of the given density."""
    dx = ufl.Measure("dx", domain=domain)
    return density * ufl.inner(acceleration, v) * dx
