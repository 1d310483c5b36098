"""Energy densities psi(F) [Pa] of isotropic hyperelastic laws in 2D (plane strain) and 3D, as UFL."""

import ufl


def neo_hookean(F, mu, lmbda):
    r"""Neo-Hookean law, psi = mu/2 (tr(F'F) - d) - mu ln J + lmbda/2 (ln J)^2, J = det F.

    First Piola-Kirchhoff stress P = mu (F - F^-T) + lmbda ln(J) F^-T: zero at F = 1, linear elasticity for small strains.
    Singular at J = 0 and undefined beyond: the solver keeps J > 0. Source: Bonet and Wood 2008, section 6.4.3.
    """
    d = F.ufl_shape[0]
    ln_J = ufl.ln(ufl.det(F))
    return mu / 2 * (ufl.inner(F, F) - d) - mu * ln_J + lmbda / 2 * ln_J**2
