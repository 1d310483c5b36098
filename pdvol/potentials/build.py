"""From a scene and a level to its terms: only what the scene names is made, and only then are its libraries loaded."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pdvol.levels.materials import CellMaterials, cell_materials
from pdvol.levels.space import LevelSpace
from pdvol.potentials.consistency import Consistency, Guide
from pdvol.potentials.elasticity import elastic_terms
from pdvol.potentials.loads import assemble_mass, load_terms
from pdvol.potentials.potential import Potential
from pdvol.scene import Barrier, Friction, Plane, Rigid, Scene, metres


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
    contacts: tuple[Potential, ...]
    rules: tuple = ()


def build_terms(
    scene: Scene,
    space: LevelSpace,
    diagonal: float,
    obstacles=(),
    materials: CellMaterials | None = None,
    guides: Sequence[Guide] = (),
) -> Terms:
    """The terms of a scene on one level. Collective.

    Parameters
    ----------
    diagonal : the scene's diagonal [m], for relative lengths
    obstacles : (vertices, edges, faces) of each `Rigid` obstacle of the scene, in order
    materials : of the level's cells; where not given, as if the level were the coarsest
    guides : what holds the level to the coarser one, if anything
    """
    materials = cell_materials(scene, space.mesh) if materials is None else materials
    mass = assemble_mass(space, materials.density)
    contacts, frictions = _contact(scene, space, diagonal, obstacles, materials.softest)
    elastic, loads = elastic_terms(space, materials), load_terms(scene, space, materials.density, mass)
    held = tuple(Consistency(space, mass, guide) for guide in guides)
    return Terms(
        mass,
        (*elastic, *loads, *contacts, *frictions, *held),
        contacts,
        _rules(scene, space, diagonal, mass, elastic, loads, contacts),
    )


def _rules(scene: Scene, space: LevelSpace, diagonal: float, mass: np.ndarray, elastic, loads, contacts) -> tuple:
    law, dhat = next(
        ((c.law, metres(c.dhat, diagonal)) for c in scene.contact if isinstance(c, Barrier)), ("convergent", 0.0)
    )
    if law == "convergent":
        return ()
    from pdvol.potentials.contact.stiffness import AdaptiveStiffness, SemiImplicitStiffness

    if law == "classic":
        return (AdaptiveStiffness(space, (*elastic, *loads), contacts, mass, dhat, diagonal),)
    return (SemiImplicitStiffness(space, elastic, contacts, mass, dhat),)


def _contact(scene: Scene, space: LevelSpace, diagonal: float, obstacles, softest: float):
    barriers = [c for c in scene.contact if isinstance(c, Barrier)]
    if not barriers:
        return (), ()
    barrier, friction = barriers[0], [c for c in scene.contact if isinstance(c, Friction)]
    dhat = metres(barrier.dhat, diagonal)
    kappa = barrier.stiffness * softest
    weighted = barrier.law == "convergent"
    contacts, frictions = [], []
    planes = tuple(o for o in scene.obstacles if isinstance(o, Plane))
    if planes:
        from pdvol.potentials.contact.planes import HalfSpaceBarrier, HalfSpaceFriction

        contacts.append(HalfSpaceBarrier(space, planes, dhat, kappa, weighted))
        names = [body.name for body in scene.bodies]
        frictions += [
            HalfSpaceFriction(
                contacts[-1], _coefficients(f, [p.name for p in planes], names), metres(f.eps_v, diagonal)
            )
            for f in friction
        ]
    from pdvol.potentials.contact.barrier import SurfaceBarrier
    from pdvol.potentials.contact.collision_surface import CollisionSurface, Obstacle
    from pdvol.potentials.contact.friction import SurfaceFriction

    rigid = [o for o in scene.obstacles if isinstance(o, Rigid)]
    surface = CollisionSurface(
        space,
        tuple(Obstacle(*geometry, o.motion, o.name) for geometry, o in zip(obstacles, rigid, strict=True)),
        dhat,
        barrier.ccd,
    )
    contacts.append(SurfaceBarrier(surface, dhat, kappa, weighted))
    parties = [o.name for o in (*scene.bodies, *rigid)]
    frictions += [
        SurfaceFriction(contacts[-1], _coefficients(f, parties, parties), metres(f.eps_v, diagonal)) for f in friction
    ]
    return tuple(contacts), tuple(frictions)


def _coefficients(friction: Friction, ones: list[str], others: list[str]) -> float | np.ndarray:
    """Friction's coefficient, or a matrix of them between named parties."""
    return (
        np.array([[friction.between(one, other) for other in others] for one in ones])
        if friction.pairs
        else friction.mu
    )
