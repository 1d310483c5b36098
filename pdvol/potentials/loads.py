"""The loads of a scene: shares of a vector, drag of flows, and pressure in closed bodies."""

from collections.abc import Callable, Sequence
from typing import assert_never

import numpy as np

from pdvol.geometry.closed_surfaces import enclosed_volume, pressed_facets, volume_gradient
from pdvol.geometry.level_mesh import LevelMesh, boundary_areas
from pdvol.geometry.nearest_in_simplex import nearest_coordinates
from pdvol.levels.model import PlacedLoad
from pdvol.levels.script import ON_TIME
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions, Rates, Term
from pdvol.scene import Flow, Force, Gravity, Impulse, Load, PointForce, Pressure, at_time


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


class Drag(Term):
    """Drag of a flow on surfaces, as a dissipation potential.

    The force on a vertex of area a is a rho c/2 |w| w with w = u - (x - x~) / h, the flow's velocity past it (x~ and h
    are start and duration of rates): minus the derivative of

        D(x) = sum of a rho c/2 (h/3) |w|^3

    by x at fixed u, which is convex: nothing is lagged but u, and rest areas stand for current ones. It is implicit: no
    step, however long, accelerates a vertex beyond the flow.

    u is taken at the step's end t1, at its start positions x_t where rates are means over the step, of first order.
    Otherwise x~ is where a vertex is at t1 - h, to second order, and u is taken on the straight line from x_t through
    x~.

    Parameters
    ----------
    felt : (n,) bool, points of the level, in the input's order, on which it may act; it does not act on those inside
        bodies
    velocity : (positions (k, d), time) -> (k, d) [m/s]
    strength : density times drag coefficient / 2 [kg/m^3]
    """

    name = "drag"

    def __init__(
        self, space: LevelSpace, felt: np.ndarray, velocity: Callable[[np.ndarray, float], np.ndarray], strength: float
    ):
        self.space, self._velocity = space, velocity
        areas = np.where(felt, boundary_areas(space.mesh), 0.0)[space.owned_points]
        self.vertices = np.flatnonzero(areas > 0)
        self._strength = strength * areas[self.vertices]

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self._start, self._duration = x_t.owned[self.vertices], t1 - t0
        self._end, self._dt = t1, t1 - t0
        self._flow = self._velocity(self._start, t1)

    def set_rates(self, rates: Rates) -> None:
        now, self._duration = self._start, rates.duration
        self._start = rates.start(now, lambda e: e.x.owned[self.vertices])
        if rates.earlier:
            ahead = now + (self._start - now) * (self._dt / (self._dt - self._duration))
            self._flow = self._velocity(ahead, self._end)

    def _past(self, x: Positions) -> tuple[np.ndarray, np.ndarray]:
        w = self._flow - (x.owned[self.vertices] - self._start) / self._duration
        return w, np.linalg.norm(w, axis=1)

    def value(self, x: Positions) -> float:
        _, speed = self._past(x)
        return self.space.reduce(float(self._strength @ speed**3) * self._duration / 3.0)

    def gradient(self, x: Positions) -> np.ndarray:
        w, speed = self._past(x)
        out = np.zeros_like(x.owned)
        out[self.vertices] = -(self._strength * speed)[:, None] * w
        return out

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        w, speed = self._past(x)
        along = w / np.maximum(speed, 1e-300)[:, None]
        blocks = speed[:, None, None] * (np.eye(self.space.dim) + along[:, :, None] * along[:, None, :])
        into.add_diagonal(self.vertices, (weight / self._duration * self._strength)[:, None, None] * blocks)


class EnclosedPressure(Term):
    """Pressure on closed surfaces: E = -p V, V the volume that they enclose, exactly that of their straight facets.

    The force on a facet is p times its vector area, shared out to its corners; all forces of a closed surface sum to
    zero. V is linear in each vertex, so its Hessian has blocks between the two ends a, b of an edge only. In 3D such a
    block is [w]_x / 6, w = l - c, c and l being the vertices opposite to the edge in the triangles that hold it as a ->
    b and as b -> a. In 2D it is half a quarter turn. The matrix of an edge, blocks S above and S' below the diagonal,
    has the eigenvalues +-|w| / 6 (+-1/2 in 2D) and, in 3D, twice zero: its absolute value is |w| / 6 (1 - w w' / |w|^2)
    on the diagonal, from which both projections follow. Every rank evaluates all facets.

    Parameters
    ----------
    facets : (k, d) int64, closed, with what is under pressure behind them
    pressure : time [s] -> [Pa]
    """

    name = "pressure"

    def __init__(self, space: LevelSpace, facets: np.ndarray, pressure: Callable[[float], float]):
        self.space, self.facets, self._at = space, facets, pressure
        self.pressure = 0.0
        n, d = len(space.mesh.points), space.dim
        halves = np.concatenate([np.roll(facets, -turn, axis=1) for turn in range(d if d == 3 else 1)])
        low, high = halves[:, :2].min(axis=1), halves[:, :2].max(axis=1)
        keys, self._edge = np.unique(low * n + high, return_inverse=True)
        self._low, self._high = keys // n, keys % n
        self._opposite = halves[:, 2] if d == 3 else None
        self._sign = np.where(halves[:, 0] == low, 1.0, -1.0)
        self.scale = 0.0

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self.pressure = self._at(t1)
        self.scale = abs(self.pressure * enclosed_volume(x_t.whole, self.facets))

    def value(self, x: Positions) -> float:
        return -self.pressure * enclosed_volume(x.whole, self.facets)

    def gradient(self, x: Positions) -> np.ndarray:
        return -self.pressure * self.space.from_input(volume_gradient(x.whole, self.facets))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        across, sizes = self._edge_blocks(x)
        across, sizes = -weight * self.pressure * across, weight * abs(self.pressure) * sizes
        low, high = self.space.point_blocks[self._low], self.space.point_blocks[self._high]
        if into.projection != "abs":
            across = across if into.projection == "none" else across / 2
            into.add_pairs(low, high, across)
            into.add_pairs(high, low, np.ascontiguousarray(across.transpose(0, 2, 1)))
        if into.projection != "none":
            sizes = sizes if into.projection == "abs" else sizes / 2
            into.add_pairs(low, low, sizes)
            into.add_pairs(high, high, sizes)

    def _edge_blocks(self, x: Positions) -> tuple[np.ndarray, np.ndarray]:
        """For each edge V's block (d, d) between its lower and its higher end, and the absolute value of both ends'
        matrix: a block (d, d) that is the same at either end.
        """
        count = len(self._low)
        if self._opposite is None:
            turn = np.array([[0.0, 0.5], [-0.5, 0.0]])
            signs = np.bincount(self._edge, self._sign, minlength=count)
            return signs[:, None, None] * turn, 0.5 * np.abs(signs)[:, None, None] * np.eye(2)
        w = np.zeros((count, 3))
        np.add.at(w, self._edge, -self._sign[:, None] * x.whole[self._opposite])
        w /= 6.0
        across = np.zeros((count, 3, 3))
        across[:, [2, 0, 1], [1, 2, 0]], across[:, [1, 2, 0], [2, 0, 1]] = w, -w
        lengths = np.linalg.norm(w, axis=1)
        n = w / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        return across, lengths[:, None, None] * (np.eye(3) - n[:, :, None] * n[:, None, :])


def load_terms(loads: Sequence[PlacedLoad], space: LevelSpace, mass: np.ndarray) -> tuple[Term, ...]:
    """The terms of a level's loads, with masses (n_owned, d). Collective."""
    return tuple(_load_term(placed.load, placed.mask, space, mass[:, 0]) for placed in loads)


def _load_term(load: Load, chosen: np.ndarray, space: LevelSpace, mass: np.ndarray) -> Term:
    mesh, d = space.mesh, space.dim
    if isinstance(load, Flow):
        return Drag(space, chosen, load.at, load.density * load.drag / 2)
    if isinstance(load, Pressure):
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
    if not isinstance(load, Impulse):
        assert_never(load)
    push, time = np.asarray(load.velocity, dtype=float), load.time * (1.0 + ON_TIME)
    return DeadLoad(space, held, lambda t0, t1: push / (t1 - t0) if t0 <= time < t1 else 0.0 * push)


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
