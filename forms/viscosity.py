"""Dissipation potentials of the material, as UFL."""

import ufl
from ufl.core.expr import Expr

from pdvol.forms.kinematics import green_strain


def kelvin_voigt(F: Expr, mu: Expr, lmbda: Expr, C_t: Expr, l_t: Expr, M: Expr) -> Expr:
    r"""mu tr(M D M D) + lmbda/2 (ln J - l_t)^2 with D = (F'F - C_t) / 2, the step's change of Green's strain from C_t,
    and the change of the volume's logarithm from l_t.

    Here mu and lmbda are Lame's times damping / dt, and the value is dt times the dissipation. Where strains are small
    this is stiffness-proportional (Rayleigh) damping. It is zero for a rigid motion, however large, and never negative.

    Green's strain of a stretch s changes by s s' when s changes by s'. The metric M has the axes of stretching, and
    1 / s along them, or 1 / s^2 where they are compressed, as elasticity is then stiffer, too. So a stretched body
    takes as many damping times to return as one that is stretched a little. Only a change of volume meets lmbda: the
    trace of Green's strain changes with any stretch, and would hold a nearly incompressible body for ever.
    """
    D = (green_strain(F) - (C_t - ufl.Identity(F.ufl_shape[0])) / 2) * M
    return mu * ufl.inner(D, ufl.transpose(D)) + lmbda / 2 * (ufl.ln(ufl.det(F)) - l_t) ** 2


def kelvin_voigt_model(F: Expr, v: Expr, w: Expr, mu: Expr, lmbda: Expr, M: Expr) -> Expr:
    r"""The second derivative of `kelvin_voigt` by F along v and w, without the curvature of D and ln J (Gauss-Newton).

    It is 2 mu tr(M D'(v) M D'(w)) + lmbda (F^-T : v) (F^-T : w) with D'(v) = sym(F'v): never negative, and without an
    eigenvalue problem. With P = F M the first part is mu (tr(P'v P'w) + v : P F'w M), which takes fewer products. What
    is left out is the step's viscous stress times v'w. Where a body is stretched fast, this holds most of the stiffness
    across the stretch, so a solve whose steps overshoot takes the whole second derivative.
    """
    P = F * M
    one, other = (ufl.transpose(P) * change for change in (v, w))
    shear = ufl.inner(one, ufl.transpose(other)) + ufl.inner(v, P * ufl.transpose(F) * w * M)
    grown, also = (ufl.inner(ufl.transpose(ufl.inv(F)), change) for change in (v, w))
    return mu * shear + lmbda * grown * also
