"""Energy densities of muscles, as UFL."""

import ufl
from ufl.core.expr import Expr


def active_fibres(F: Expr, tension: Expr) -> Expr:
    r"""F'F : T / 2 with the tension T = tension f f', f the unit fibre at rest, which makes it tension/2 |F f|^2: the
    first Piola-Kirchhoff stress is P = F T. Where T is a mean over several cells, their energies add up.

    The active stress along the fibre that models of the heart add to the passive one, there with a tension that depends
    on the stretch (Nash and Panfilov 2004; Quarteroni et al. 2017, Integrated heart). It is convex and quadratic in F,
    so its Hessian is constant and needs no filter.
    """
    return ufl.inner(F * tension, F) / 2
