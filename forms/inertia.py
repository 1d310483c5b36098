"""Inertia, lumped at the vertices."""

import ufl
from ufl.core.expr import Expr


def inertia(density: Expr, u: Expr, domain: ufl.Mesh) -> ufl.Form:
    """1/2 |u|^2_M with the lumped mass matrix M: the kinetic energy [J] of a velocity u [m/s], and the inertia [kg m^2]
    of a step whose end is u [m] away from the prediction.

    Vertex quadrature lumps: M, the second derivative, is diagonal for vector P1.

    Parameters
    ----------
    density : [kg/m^d], UFL
    u : (d,), a function of a vector P1 space
    domain : mesh of that space
    """
    dx = ufl.Measure("dx", domain=domain, metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})
    return density / 2 * ufl.inner(u, u) * dx
