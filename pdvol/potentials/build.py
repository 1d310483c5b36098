"""From a level's model to its terms: only what the scene names is made, and only then are its libraries loaded."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pdvol.levels.model import LevelModel
from pdvol.levels.space import LevelSpace
from pdvol.potentials.consistency import Consistency, Guide
from pdvol.potentials.elasticity import elastic_terms
from pdvol.potentials.loads import assemble_mass, load_terms
from pdvol.potentials.potential import ContactPotential, Potential


@dataclass(frozen=True)
class Terms:
    """What one level minimises.

    Attributes
    ----------
    mass : (n_owned, d) [kg]
    potentials : all terms
    contacts : those among them that know contacts (`count`, `min_gap`)
    rules : what sets the contacts' stiffness at each step's start, where the barrier's law wants that
    """

    mass: np.ndarray
    potentials: tuple[Potential, ...]
    contacts: tuple[ContactPotential, ...]
    rules: tuple = ()


def build_terms(model: LevelModel, space: LevelSpace, guides: Sequence[Guide] = ()) -> Terms:
    """The terms of a level. Collective.

    Parameters
    ----------
    guides : what holds the level to the coarser one, if anything
    """
    mass = assemble_mass(space, model.materials.density)
    contacts, frictions = _contact(model, space)
    elastic = elastic_terms(space, model.materials)
    loads = load_terms(model.loads, space, model.materials.density, mass)
    held = tuple(Consistency(space, mass, guide) for guide in guides)
    rules = _stiffness_rules(model, space, mass, elastic, loads, contacts)
    return Terms(mass, (*elastic, *loads, *contacts, *frictions, *held), contacts, rules)


def _stiffness_rules(model: LevelModel, space: LevelSpace, mass: np.ndarray, elastic, loads, contacts) -> tuple:
    rules = []
    for contact in model.contact:
        if contact.law == "convergent":
            continue
        from pdvol.potentials.contact.stiffness import AdaptiveStiffness, SemiImplicitStiffness

        if contact.law == "classic":
            others = (*elastic, *loads)
            rules.append(AdaptiveStiffness(space, others, contacts, mass, contact.dhat, model.diagonal))
        else:
            rules.append(SemiImplicitStiffness(space, elastic, contacts, mass, contact.dhat))
    return tuple(rules)


def _contact(model: LevelModel, space: LevelSpace) -> tuple[tuple[ContactPotential, ...], tuple[Potential, ...]]:
    contacts: list[ContactPotential] = []
    frictions: list[Potential] = []
    planes, surfaces = (tuple(o for o in model.obstacles if (o.kind == "plane") == flat) for flat in (True, False))
    for contact in model.contact:
        weighted = contact.law == "convergent"
        if planes:
            from pdvol.potentials.contact.planes import HalfSpaceBarrier, HalfSpaceFriction

            contacts.append(HalfSpaceBarrier(space, planes, contact.dhat, contact.kappa, weighted))
            frictions += [HalfSpaceFriction(contacts[-1], f.mu_planes, f.eps_v) for f in contact.friction]
        from pdvol.potentials.contact.barrier import SurfaceBarrier
        from pdvol.potentials.contact.collision_surface import CollisionSurface
        from pdvol.potentials.contact.friction import SurfaceFriction

        surface = CollisionSurface(space, surfaces, contact.dhat, contact.ccd)
        contacts.append(SurfaceBarrier(surface, contact.dhat, contact.kappa, weighted))
        frictions += [SurfaceFriction(contacts[-1], f.mu_surfaces, f.eps_v) for f in contact.friction]
    return tuple(contacts), tuple(frictions)
