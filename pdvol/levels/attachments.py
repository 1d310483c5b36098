"""The springs of attachments and pulls: chosen on the coarsest level, bound to the same material on every level."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.boundary_search import nearest_points
from pdvol.geometry.closed_surfaces import gyration_diagonal
from pdvol.geometry.level_mesh import LevelMesh, facet_sizes
from pdvol.levels.locate import behind_nearest_facets, inner_weights, nearest_material
from pdvol.levels.materials import cell_materials
from pdvol.scene import Attachment, Gravity, Pull, Scene, at_time
from pdvol.scene.checks import chosen, near, require

REACH = 0.2  # seconds in which a pull brings the patch of a free body to its point, but for 9 % of the way
PATCH = 0.15  # of a body's diagonal: radius of a patch, which some facets of coarse levels have their centres in
# Strain that a pull's force is for its patch: neo-Hookean cells bear it, and a picture shows that something pulls.
STRAIN = 0.5
# Weights of the body: a pull's force at most, for any softness, which lifts it, and for any stiffness.
LEAST_WEIGHTS, MOST_WEIGHTS = 2.0, 20.0


@dataclass(frozen=True, eq=False)
class BoundSprings:
    """Springs on a level: a spring's vector is the sum of weights times positions of points.

    Attributes
    ----------
    points : (k, 2 d + 2) int64, the corners of the cells at both ends
    weights : (k, 2 d + 2) barycentric coordinates in these cells, those of the first end negative
    stiffness, rest_length, strength : (k,) [N/m], [m], [N]
    """

    points: np.ndarray
    weights: np.ndarray
    stiffness: np.ndarray
    rest_length: np.ndarray
    strength: np.ndarray


def bound_springs(
    scene: Scene, coarsest: LevelMesh, begun: np.ndarray, mesh: LevelMesh, start: np.ndarray
) -> tuple[BoundSprings, ...]:
    """The springs of all attachments of a scene on a level, as one `BoundSprings`; none where there are no attachments.
    They are chosen on the coarsest level: parts by their rest positions, and the nearest places to them where points
    are at t = 0.

    Parameters
    ----------
    begun : (n, d) [m]
        Where the coarsest level's points are at t = 0.
    start : (n, d) [m]
        The same of the level's own.

    Raises
    ------
    InputError
        A part holds no facet, or a function of the scene fails.
    """
    if not scene.attachments:
        return ()
    chosen = [_chosen(scene, attachment, coarsest, begun) for attachment in scene.attachments]
    ends, bodies, stiffness, rest, strength = (np.concatenate(parts) for parts in zip(*chosen, strict=True))
    cells, weights = nearest_material(mesh, ends.reshape(-1, mesh.dim), bodies.ravel())
    points = mesh.cells[cells].reshape(len(ends), -1)
    weights = (np.array([-1.0, 1.0])[:, None] * weights.reshape(len(ends), 2, -1)).reshape(points.shape)
    lengths = np.linalg.norm(np.einsum("ka,kai->ki", weights, start[points]), axis=1)
    return (BoundSprings(points, weights, stiffness, np.where(np.isnan(rest), lengths, rest), strength),)


def _chosen(scene: Scene, attachment: Attachment, mesh: LevelMesh, start: np.ndarray) -> tuple[np.ndarray, ...]:
    """Of k springs: rest positions of their ends (k, 2, d) [m] and the bodies (k, 2) that these belong to; stiffness
    (k,) [N/m]; rest length (k,) [m], NaN for the length at t = 0; strength (k,) [N], inf where one never breaks.
    """
    names = [body.name for body in scene.bodies]
    bodies = names.index(attachment.body), names.index(attachment.other)
    starts, fractions = _starts(mesh, bodies[0], attachment)
    ends = _ends(mesh, start, bodies, attachment, starts)
    count, length, strength = len(starts), attachment.rest_length, attachment.breaking
    return (
        np.stack([starts, ends], axis=1),
        np.tile(bodies, (count, 1)),
        attachment.stiffness * fractions,
        np.full(count, np.nan if length is None else length),
        np.full(count, np.inf) if strength is None else strength * fractions,
    )


def _starts(mesh: LevelMesh, body: int, attachment: Attachment) -> tuple[np.ndarray, np.ndarray]:
    """Where springs begin (k, d) [m], and the fraction of the attached area (k,) that each stands for."""
    if not callable(attachment.where):
        return _one_place(mesh, body, attachment.body, "Attachment.where", attachment.where), np.ones(1)
    facets = mesh.boundary[_part(mesh, body, attachment.body, "Attachment.where", attachment.where)]
    sizes = facet_sizes(mesh.points, facets)
    return mesh.points[facets].mean(axis=1), sizes / sizes.sum()


def _ends(
    mesh: LevelMesh, start: np.ndarray, bodies: tuple[int, int], attachment: Attachment, starts: np.ndarray
) -> np.ndarray:
    """Where springs end (k, d) [m], at rest, that begin at `starts` (k, d), at rest."""
    body, other = bodies
    if not callable(attachment.to):
        place = _one_place(mesh, other, attachment.other, "Attachment.to", attachment.to)
        return np.repeat(place, len(starts), axis=0)
    part = _part(mesh, other, attachment.other, "Attachment.to", attachment.to)
    facets = mesh.boundary[part]
    if start is mesh.points:
        return nearest_points(mesh.points, facets, starts)[1]
    cells, weights = nearest_material(mesh, starts, np.full(len(starts), body))
    facet, places = nearest_points(start, facets, np.einsum("kc,kci->ki", weights, start[mesh.cells[cells]]))
    behind = mesh.boundary_cells[part[facet]]
    weights = replace(mesh, points=start).coordinates(behind, places)
    return np.einsum("kc,kci->ki", weights, mesh.points[mesh.cells[behind]])


def _one_place(mesh: LevelMesh, body: int, name: str, what: str, place: Any) -> np.ndarray:
    """(1, d) [m]: a rest position that is given in a body."""
    require(len(place) == mesh.dim, f"{what} = {tuple(place)} has {len(place)} components in a {mesh.dim}D scene")
    near(what, np.asarray(place, dtype=float), mesh.points[mesh.point_bodies == body], name)
    return np.asarray(place, dtype=float)[None, :]


def _part(mesh: LevelMesh, body: int, name: str, what: str, where: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(k,) int64: the boundary facets of a body whose centres are chosen, by their rows in the level's."""
    mine = np.flatnonzero(mesh.bodies[mesh.boundary_cells] == body)
    held = chosen(what, where, mesh.on_the_shape[mesh.boundary[mine]].mean(axis=1))
    if not held.any():
        raise InputError(
            f"{what} holds no boundary facet of body {name!r} on the coarsest level; widen it, or give that level more"
            " vertices"
        )
    return mine[held]


BoundPull = tuple[np.ndarray, np.ndarray, tuple[float, float, float]]
"""A pull on a level: the points (m,) of its patch, their shares (m,), whose sum is one, and the law of its spring:
stiffness k [N/m], the length [m] at which the force k times that length is nearly its bound, and the time [s] in which
the damper is as strong as the spring.
"""


class Pulls:
    """The pulls of a scene and of its hand on a level.

    Parameters
    ----------
    coarsest, mesh : of the coarsest level, on which patches are chosen, and of this one
    """

    def __init__(self, scene: Scene, coarsest: LevelMesh, mesh: LevelMesh):
        self.hand, self._scene, self._coarsest, self._mesh = scene.hand, scene, coarsest, mesh
        self._bound: dict[tuple, BoundPull] = {}

    def acting(self, t0: float, t1: float) -> dict[Any, Pull]:
        """Those that act in a step or a part of one, from t0 to t1 [s], by what distinguishes them."""
        dt = self._scene.dt
        found: dict[Any, Pull] = {i: pull for i, pull in enumerate(self._scene.pulls) if pull.acts(t0, t1)}
        if self.hand is not None:
            step = int(np.ceil(t1 / dt - 1e-6))
            before = {each["number"]: each["point"] for each in self.hand.line(step - 1)["pulls"]}
            for each in self.hand.line(step)["pulls"]:
                grip, last = each.get("grip", np.zeros(self._mesh.dim)), before.get(each["number"], each["point"])
                keys, times = [np.add(point, grip) for point in (last, each["point"])], ((step - 1) * dt, step * dt)
                found["hand", each["number"]] = Pull(each["body"], each["place"], times, keys, each.get("stiffness"))
        return found

    def change(self, step: int) -> bool:
        """Whether others act in the step after this one than in it."""
        start, end, after = ((step + k) * self._scene.dt for k in (-1, 0, 1))
        held = [self.hand and {each["number"] for each in self.hand.line(n)["pulls"]} for n in (step, step + 1)]
        return held[0] != held[1] or any(p.acts(start, end) != p.acts(end, after) for p in self._scene.pulls)

    def bound(self, pull: Pull) -> BoundPull:
        """A pull on the level. Raises InputError where its body is unknown, or its place lies far outside."""
        key = (pull.body, pull.where, pull.stiffness, pull.radius)
        if key not in self._bound:
            self._bound[key] = self._bind(pull)
        return self._bound[key]

    def check(self) -> None:
        """Raises InputError where a pull of the scene, or of the hand so far, fits no level."""
        steps = range(0 if self.hand is None else self.hand.steps)
        hands = (pull for i in steps for pull in self.acting(i * self._scene.dt, (i + 1) * self._scene.dt).values())
        for pull in (*self._scene.pulls, *hands):
            self.bound(pull)

    def _bind(self, pull: Pull) -> BoundPull:
        mesh, scene, names = self._coarsest, self._scene, [body.name for body in self._scene.bodies]
        require(pull.body in names, f"a Pull names the body {pull.body!r}; there are {names}")
        number = names.index(pull.body)
        place = _one_place(mesh, number, pull.body, "Pull.where", pull.where)
        mine = np.flatnonzero(mesh.bodies[mesh.boundary_cells] == number)
        facets = mesh.boundary[mine]
        diagonal, centres = gyration_diagonal(mesh.points, facets), mesh.points[facets].mean(axis=1)
        distances = np.linalg.norm(centres - place, axis=1)
        patch = distances <= max(pull.radius or PATCH * diagonal, distances.min())
        sizes, cells = facet_sizes(mesh.points, facets[patch]), mesh.bodies == number
        materials = cell_materials(scene, mesh)
        mass = float(materials.density[cells] @ mesh.volumes[cells])
        stiffness = pull.stiffness or mass * (4.0 / REACH) ** 2
        falls = [at_time("gravity", g.acceleration, 0.0, mesh.dim) for g in scene.loads if isinstance(g, Gravity)]
        weight = mass * float(np.linalg.norm(np.sum(falls, axis=0))) or stiffness * diagonal / MOST_WEIGHTS
        soft = STRAIN * float(materials.young[mesh.boundary_cells[mine[patch]]].min() * sizes.sum())
        most = float(np.clip(soft, LEAST_WEIGHTS * weight, MOST_WEIGHTS * weight))
        ends, bodies = centres[patch], np.full(patch.sum(), number)
        cells, places = behind_nearest_facets(self._mesh, ends, bodies, np.full(len(ends), -1))
        weights = inner_weights(self._mesh, cells, places) * (sizes / sizes.sum())[:, None]
        points, rows = np.unique(self._mesh.cells[cells], return_inverse=True)
        shares = np.bincount(rows.ravel(), weights.ravel())
        kept = shares > 0.0
        damping = 2.0 * float(np.sqrt(mass / stiffness))  # critical of a rigid body
        return points[kept], shares[kept], (stiffness, most / stiffness, damping)
