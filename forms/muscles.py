"""Energy densities of muscles, as UFL."""

from collections.abc import Sequence

import ufl
from ufl.core.expr import Expr


def active_fibre(F: Expr, tension: Expr, fibre: Sequence[Expr]) -> Expr:
    r"""tension/2 |F f|^2, f the unit fibre at rest: the first Piola-Kirchhoff stress is P = tension F f f'.

    The active stress along the fibre that models of the heart add to the passive one, there with a tension that depends
    on the stretch (Nash and Panfilov 2004; Quarteroni et al. 2017, Integrated heart). It is convex and quadratic in F,
    so its Hessian is constant and needs no filter.
    """
    pulled = F * ufl.as_vector(list(fibre))
    return tension / 2 * ufl.inner(pulled, pulled)
