"""Dissipation potentials of the material, as UFL."""

import ufl
from ufl.core.expr import Expr

from pdvol.forms.kinematics import green_strain


def kelvin_voigt(F: Expr, mu: Expr, lmbda: Expr, C_t: Expr) -> Expr:
    r"""mu |D|^2 + lmbda/2 (tr D)^2 with D = (F'F - C_t) / 2, the step's change of Green's strain from C_t = F_t'F_t.

    Here mu and lmbda are Lame's times damping / dt, and E' is the strain's rate. The value is dt times the dissipation
    of the second Piola-Kirchhoff stress `damping (2 mu E' + lmbda tr(E') 1)`. Where strains are small this is
    stiffness-proportional (Rayleigh) damping. It is zero for a rigid motion, however large, and never negative.
    """
    D = green_strain(F) - (C_t - ufl.Identity(F.ufl_shape[0])) / 2
    return mu * ufl.inner(D, D) + lmbda / 2 * ufl.tr(D) ** 2


def kelvin_voigt_model(F: Expr, v: Expr, w: Expr, mu: Expr, lmbda: Expr) -> Expr:
    r"""The second derivative of `kelvin_voigt` by F along v and w, without the curvature of D (Gauss-Newton).

    It is 2 mu D'(v) : D'(w) + lmbda tr D'(v) tr D'(w) with D'(v) = sym(F'v): never negative, and without an
    eigenvalue problem. What is left out is the step's viscous stress times v'w. Where a body is stretched fast, this
    holds most of the stiffness across the stretch, so a solve whose steps overshoot takes the whole second derivative.
    """
    one, other = (ufl.sym(ufl.transpose(F) * change) for change in (v, w))
    return 2 * mu * ufl.inner(one, other) + lmbda * ufl.tr(one) * ufl.tr(other)
