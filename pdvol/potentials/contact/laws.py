"""Contact laws: whether contacts are weighted by area, and the rules that choose their stiffness at each step's start.

A law is a class with `weighted` and `rules(surroundings)`, and one line in `pdvol.registry`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pdvol.potentials.build import Surroundings
    from pdvol.potentials.contact.stiffness import AdaptiveStiffness, SemiImplicitStiffness


class Convergent:
    """Contacts weighted by area, the same on every level; the scene gives the stiffness (Li et al. 2023)."""

    weighted = True

    @staticmethod
    def rules(found: Surroundings) -> tuple[()]:
        """None: the stiffness is constant."""
        return ()


class Classic:
    """Each contact alike, its stiffness adapted to the forces at the step's start (Li et al. 2020)."""

    weighted = False

    @staticmethod
    def rules(found: Surroundings) -> tuple[AdaptiveStiffness]:
        """The rule of ipctk."""
        from pdvol.potentials.contact.stiffness import AdaptiveStiffness

        others = (*found.elastic, *found.loads)
        return (AdaptiveStiffness(found.space, others, found.contacts, found.mass, found.dhat, found.diagonal),)


class SemiImplicit:
    """Each contact alike, its stiffness from masses, gaps and elastic stiffness (Ando 2024)."""

    weighted = False

    @staticmethod
    def rules(found: Surroundings) -> tuple[SemiImplicitStiffness]:
        """One stiffness for the whole level at each step's start."""
        from pdvol.potentials.contact.stiffness import SemiImplicitStiffness

        return (SemiImplicitStiffness(found.space, found.elastic, found.contacts, found.mass, found.dhat),)
