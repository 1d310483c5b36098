"""Dissipation potentials of the material, as UFL."""

import ufl
from ufl.core.expr import Expr

from pdvol.forms.kinematics import green_strain


def kelvin_voigt(F: Expr, mu: Expr, lmbda: Expr, C_t: Expr) -> Expr:
    r"""mu |D|^2 + lmbda/2 (tr D)^2 with D = (F'F - C_t) / 2, the step's change of Green's strain from C_t = F_t'F_t.

    With mu and lmbda being Lame's times damping / dt this is dt times the dissipation whose stress (second
    Piola-Kirchhoff) is damping (2 mu E' + lmbda tr(E') 1), E' the strain's rate: stiffness-proportional (Rayleigh)
    damping where strains are small, and nothing for a rigid motion, however large. At least zero, least where nothing
    deforms.
    """
    D = green_strain(F) - (C_t - ufl.Identity(F.ufl_shape[0])) / 2
    return mu * ufl.inner(D, D) + lmbda / 2 * ufl.tr(D) ** 2
