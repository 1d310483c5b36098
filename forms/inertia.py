"""Inertia, lumped at the vertices."""

import ufl
from ufl.core.expr import Expr


def lumped_mass(density: Expr, v: Expr, domain: ufl.Mesh) -> ufl.Form:
    """Linear form whose assembly is the diagonal of the lumped mass matrix [kg]: vertex quadrature makes P1 masses
    diagonal.

    Parameters
    ----------
    density : [kg/m^d], UFL
    v : test function of a vector P1 space
    domain : mesh of that space
    """
    dx = ufl.Measure("dx", domain=domain, metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})
    return density * sum(v[i] for i in range(v.ufl_shape[0])) * dx
