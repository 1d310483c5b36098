"""From a level's model to its terms. Terms that the scene does not need are not made, nor their libraries loaded."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pdvol.geometry.level_mesh import lumped_masses
from pdvol.levels.model import LevelModel
from pdvol.levels.script import Obstacle, Script
from pdvol.levels.space import LevelSpace
from pdvol.potentials.attachments import Attachments, Pulling
from pdvol.potentials.consistency import Consistency, Guide
from pdvol.potentials.elasticity import ActiveFibres, elastic_terms
from pdvol.potentials.loads import load_terms
from pdvol.potentials.potential import Term
from pdvol.scene import Barrier, Friction, metres

if TYPE_CHECKING:  # a scene without contact loads none of it
    from pdvol.potentials.contact.barrier import ContactBarrier
    from pdvol.potentials.contact.friction import LaggedFriction

MakeTerm = Callable[[LevelModel, LevelSpace], Term]
"""What makes a term of a user's own on a level; a class whose instances it takes, or a function. Collective."""


@dataclass(frozen=True)
class Terms:
    """The terms that one level minimises.

    Attributes
    ----------
    mass : (n_owned, d) [kg]
    potentials : all terms
    contacts, frictions : the barriers and friction terms among them
    """

    mass: np.ndarray
    potentials: tuple[Term, ...]
    contacts: tuple["ContactBarrier", ...] = ()
    frictions: tuple["LaggedFriction", ...] = ()


def build_terms(
    model: LevelModel,
    space: LevelSpace,
    guides: Sequence[Guide] = (),
    script: Script | None = None,
    own: Sequence[MakeTerm] = (),
) -> Terms:
    """The terms of a level. Collective.

    Parameters
    ----------
    guides : guides that hold the level to the coarser one, if any
    script : of the obstacles' motions; all on time where not given
    own : terms of a user's own
    """
    mass = np.tile(space.from_input(lumped_masses(space.mesh, model.materials.density))[:, None], space.dim)
    names, softest = [*model.bodies, *(o.name for o in model.obstacles)], model.materials.softest
    contacts, frictions = contact_terms(model.contact, names, model.obstacles, space, model.diagonal, softest, script)
    elastic = elastic_terms(space, model.materials)
    loads = load_terms(model.loads, space, mass)
    loads += tuple(ActiveFibres(space, muscle, model.materials.smoothing) for muscle in model.muscles)
    loads += tuple(Attachments(space, springs) for springs in model.springs)
    loads += tuple(Pulling(space, pulls) for pulls in model.pulls)
    held = tuple(Consistency(space, mass, guide) for guide in guides)
    users = tuple(make(model, space) for make in own)
    return Terms(mass, (*elastic, *loads, *users, *contacts, *held, *frictions), contacts, frictions)


def contact_terms(
    contact: Sequence[Barrier | Friction],
    names: Sequence[str],
    obstacles: Sequence[Obstacle],
    space: LevelSpace,
    diagonal: float,
    softest: float,
    script: Script | None = None,
) -> tuple[tuple["ContactBarrier", ...], tuple["LaggedFriction", ...]]:
    """The terms of a scene's barrier, none or one, and of its friction. Collective.

    Parameters
    ----------
    names : of the bodies and, behind them, the obstacles
    diagonal : of the smallest free body [m]
    softest : the lowest Young's modulus [Pa]
    """
    if not contact:
        return (), ()
    from pdvol.potentials.contact.barrier import ContactBarrier
    from pdvol.potentials.contact.candidates import Candidates
    from pdvol.potentials.contact.friction import LaggedFriction
    from pdvol.potentials.contact.surface import ContactSurface

    contacts, frictions = list[ContactBarrier](), list[LaggedFriction]()
    for barrier in (each for each in contact if isinstance(each, Barrier)):
        candidates = Candidates(ContactSurface(space, tuple(obstacles), script), metres(barrier.dhat, diagonal))
        contacts.append(ContactBarrier(candidates, barrier.kappa(softest)))
        for each in (each for each in contact if isinstance(each, Friction)):
            mu = np.array([[each.between(one, other) for other in names] for one in names]) if each.pairs else each.mu
            frictions.append(LaggedFriction(contacts[-1], mu, metres(each.eps_v, diagonal)))
    return tuple(contacts), tuple(frictions)
