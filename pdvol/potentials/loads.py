"""The loads of a scene, which are shares of a vector."""

from collections.abc import Callable, Sequence

import numpy as np

from pdvol.geometry.closed_surfaces import pressed_facets
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.geometry.nearest_in_simplex import nearest_coordinates
from pdvol.levels.model import PlacedLoad
from pdvol.levels.space import LevelSpace
from pdvol.potentials.potential import Positions, Term
from pdvol.scene import Flow, Force, Gravity, Load, PointForce, Pressure, at_time


class DeadLoad(Term):
    """A load whose force [N] does not depend on x: shares (n_owned,) of a vector (t0, t1) -> (d,), evaluated at each
    step's start.

    E = -f . (x - X) with the rest positions X. Of positions alone, far from the origin, it would be so large that no
    line search could see what a step gains.
    """

    name = "load"

    def __init__(self, space: LevelSpace, shares: np.ndarray, vector: Callable[[float, float], np.ndarray]):
        self.space, self._rest = space, space.from_input(space.mesh.points)
        self._shares, self._vector, self.force = shares, vector, np.zeros((space.n_owned, space.dim))

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self.force = np.outer(self._shares, self._vector(t0, t1))

    def value(self, x: Positions) -> float:
        return -self.space.reduce(float(np.vdot(self.force, x.owned - self._rest)))

    def gradient(self, x: Positions) -> np.ndarray:
        return -self.force


def load_terms(loads: Sequence[PlacedLoad], space: LevelSpace, mass: np.ndarray) -> tuple[Term, ...]:
    """The terms of a level's loads, with masses (n_owned, d). Collective."""
    return tuple(_load_term(placed.load, placed.mask, space, mass[:, 0]) for placed in loads)


def _load_term(load: Load, chosen: np.ndarray, space: LevelSpace, mass: np.ndarray) -> Term:
    mesh, d = space.mesh, space.dim
    if isinstance(load, Flow):
        from pdvol.potentials.drag import Drag

        return Drag(space, chosen, load.at, load.density * load.drag / 2)
    if isinstance(load, Pressure):
        from pdvol.potentials.pressure import EnclosedPressure

        return EnclosedPressure(space, pressed_facets(mesh, int(mesh.point_bodies[chosen][0])), load.at)
    if isinstance(load, Gravity):
        return DeadLoad(space, mass, lambda t0, t1: at_time("gravity", load.acceleration, t1, d))
    if isinstance(load, PointForce):
        shares = space.from_input(point_shares(mesh, chosen, np.asarray(load.at, dtype=float)))
        return DeadLoad(space, shares, lambda t0, t1: at_time("PointForce.force", load.force, t1, d))
    held = np.where(chosen[space.owned_points], mass, 0.0)
    if isinstance(load, Force):
        shares = held / space.reduce(float(held.sum()))
        return DeadLoad(space, shares, lambda t0, t1: at_time("Force.force", load.force, t1, d))
    push = np.asarray(load.velocity, dtype=float)
    return DeadLoad(space, held, lambda t0, t1: push / (t1 - t0) if t0 <= load.time < t1 else 0.0 * push)


def point_shares(mesh: LevelMesh, chosen: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(n,) the share of a force at a rest position (d,) that each point takes: barycentric in the cell nearest to it,
    of points `chosen`.
    """
    cells = mesh.cells[chosen[mesh.cells].all(axis=1)]
    weights = nearest_coordinates(np.broadcast_to(at, (len(cells), mesh.dim)), mesh.points[cells])
    off = np.linalg.norm(np.einsum("ki,kij->kj", weights, mesh.points[cells]) - at, axis=1)
    nearest = int(off.argmin())
    shares = np.zeros(len(mesh.points))
    shares[cells[nearest]] = weights[nearest]
    return shares
