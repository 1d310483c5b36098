"""Deformation measures as UFL. Positions x live on the rest mesh, so grad(x) is the deformation gradient."""

import ufl


def deformation_gradient(x):
    """F = dx/dX, shape (d, d)."""
    return ufl.grad(x)
