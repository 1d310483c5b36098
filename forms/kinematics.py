"""Deformation measures as UFL. Positions x live on the rest mesh, so grad(x) is the deformation gradient."""

import ufl
from ufl.core.expr import Expr

NEWTON = 4  # iterations for the sum of three stretches: exact to the last bit, as are two derivatives (see there)


def green_strain(F: Expr) -> Expr:
    """E = (F'F - 1) / 2, shape (d, d). In plane strain the entries that are left out are zero.

    Parameters
    ----------
    F : (d, d) deformation gradient, UFL
    """
    return (F.T * F - ufl.Identity(F.ufl_shape[0])) / 2


def sum_of_stretches(F: Expr) -> Expr:
    r"""tr S of F = R S, the sum of the d stretches, for det F > 0: without the singular derivatives of an eigenvalue
    solver.

    In 2D it is `t = sqrt(tr C + 2 J)` with `C = F'F`. In 3D the second invariant of S is `i = s0 s1 + s1 s2 + s2 s0`.
    It gives `t^2 = tr C + 2 i` and `i^2 = |cof F|^2 + 2 J t`. So t is the fixed point of
    `phi(t) = sqrt(tr C + 2 sqrt(|cof F|^2 + 2 J t))`, whose slope `J / (t i)` is at most 1/9. Newton on `t - phi(t)`
    begins at `sqrt(3 tr C)`, which is exact at rest and never too small. Four iterations are exact to the last bit for
    any F, and their derivatives are those of t.
    """
    J, a = ufl.det(F), ufl.inner(F, F)
    if F.ufl_shape[0] == 2:
        return ufl.sqrt(a + 2 * J)
    cofactors = ufl.cofac(F)
    b = ufl.inner(cofactors, cofactors)
    t = ufl.sqrt(3 * a)
    for _ in range(NEWTON):
        i = ufl.sqrt(b + 2 * J * t)
        phi = ufl.sqrt(a + 2 * i)
        t = t - (t - phi) / (1 - J / (i * phi))
    return t
