"""Energy densities psi(F) [Pa] of isotropic hyperelastic laws in 2D (plane strain: the third stretch is one) and 3D, as
UFL.

All are zero and free of stress at F = 1 and become linear elasticity with Lame's mu and lmbda [Pa] for small strains.
They are meant for J = det F > 0, which the solver keeps whatever the law.
"""

import ufl
from ufl.core.expr import Expr

from pdvol.forms.kinematics import green_strain, sum_of_stretches

GUARDED = 0.1  # of a cell's volume: below it laws that are finite at zero volume get a barrier


def volume_barrier(F: Expr, stiffness: Expr) -> Expr:
    r"""-stiffness (u - 1)^2 ln u where u = J / GUARDED is below one, nothing above: twice differentiable, infinite at
    zero volume.

    It keeps cells of laws that give way from being pressed to nothing, and leaves the law as it is down to a tenth of a
    cell's volume.

    Parameters
    ----------
    F : (d, d) deformation gradient, UFL
    stiffness : [Pa]
    """
    u = ufl.det(F) / GUARDED
    return ufl.conditional(ufl.lt(u, 1), -stiffness * (u - 1) ** 2 * ufl.ln(u), 0)


def neo_hookean(F: Expr, mu: Expr, lmbda: Expr) -> Expr:
    r"""Neo-Hookean law, psi = mu/2 (tr(F'F) - d) - mu ln J + lmbda/2 (ln J)^2.

    First Piola-Kirchhoff stress P = mu (F - F^-T) + lmbda ln(J) F^-T: infinite at zero volume. Source: Bonet and Wood
    2008, section 6.4.3.
    """
    d = F.ufl_shape[0]
    ln_J = ufl.ln(ufl.det(F))
    return mu / 2 * (ufl.inner(F, F) - d) - mu * ln_J + lmbda / 2 * ln_J**2


def st_venant_kirchhoff(F: Expr, mu: Expr, lmbda: Expr) -> Expr:
    r"""St. Venant-Kirchhoff law, psi = mu tr(E^2) + lmbda/2 (tr E)^2, E = (F'F - 1) / 2.

    P = F (2 mu E + lmbda tr(E) 1). It gives way in compression: pressed along one axis the stress is largest at a
    stretch of 1/sqrt(3) and falls from there on, until below a tenth of the volume `volume_barrier` stops the collapse.
    Source: Bonet and Wood 2008, section 6.4.1.
    """
    E = green_strain(F)
    return mu * ufl.inner(E, E) + lmbda / 2 * ufl.tr(E) ** 2 + volume_barrier(F, 2 * mu + lmbda)


def fixed_corotational(F: Expr, mu: Expr, lmbda: Expr) -> Expr:
    r"""Fixed corotational law, psi = mu |F - R|^2 + lmbda/2 (J - 1)^2, F = R S the polar decomposition.

    Its stress is `P = 2 mu (F - R) + lmbda (J - 1) cof F`, with `|F - R|^2 = tr C - 2 tr S + d`. But for the volume's
    part it is linear in the stretches. At zero volume it is finite (2 mu + lmbda when pressed along one axis), so
    `volume_barrier` is added below a tenth of the volume.
    Source: Stomakhin et al. 2012, Energetically Consistent Invertible Elasticity.
    """
    d = F.ufl_shape[0]
    return (
        mu * (ufl.inner(F, F) - 2 * sum_of_stretches(F) + d)
        + lmbda / 2 * (ufl.det(F) - 1) ** 2
        + volume_barrier(F, 2 * mu + lmbda)
    )
