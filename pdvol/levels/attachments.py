"""The springs of a scene's attachments: chosen on the coarsest level, bound to the same material on every level."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.boundary_search import nearest_points
from pdvol.geometry.level_mesh import LevelMesh, facet_sizes
from pdvol.levels.locate import nearest_material
from pdvol.scene import Attachment, Scene
from pdvol.scene.checks import chosen, near, require


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs between material points of a scene, whatever its levels; k of them.

    Attributes
    ----------
    ends : (2, k, d) [m]
        Rest positions.
    bodies : (2, k) int
        The bodies that these belong to.
    stiffness : (k,) [N/m]
    rest_length : (k,) [m], NaN for the length at t = 0
    strength : (k,) [N], inf where a spring never breaks
    """

    ends: np.ndarray
    bodies: np.ndarray
    stiffness: np.ndarray
    rest_length: np.ndarray
    strength: np.ndarray


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


def attachment_springs(scene: Scene, mesh: LevelMesh, start: np.ndarray) -> Springs:
    """The springs of all attachments of a scene, chosen on its coarsest level's mesh: parts by their rest positions,
    and the nearest places to them where points are at t = 0, `start` (n, d) [m].

    Raises
    ------
    InputError
        A part holds no facet, or a function of the scene fails.
    """
    return _joined([_chosen(scene, attachment, mesh, start) for attachment in scene.attachments], mesh.dim)


def _chosen(scene: Scene, attachment: Attachment, mesh: LevelMesh, start: np.ndarray) -> Springs:
    names = [body.name for body in scene.bodies]
    bodies = names.index(attachment.body), names.index(attachment.other)
    starts, fractions = _starts(mesh, bodies[0], attachment)
    ends = _ends(mesh, start, bodies, attachment, starts)
    count = len(starts)
    length, strength = attachment.rest_length, attachment.breaking
    return Springs(
        ends=np.stack([starts, ends]),
        bodies=np.repeat(np.array(bodies)[:, None], count, axis=1),
        stiffness=attachment.stiffness * fractions,
        rest_length=np.full(count, np.nan if length is None else length),
        strength=np.full(count, np.inf) if strength is None else strength * fractions,
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


def _joined(parts: list[Springs], dim: int) -> Springs:
    if not parts:
        none = np.zeros(0)
        return Springs(np.zeros((2, 0, dim)), np.zeros((2, 0), dtype=int), none, none, none)
    return Springs(
        *(np.concatenate([getattr(p, name) for p in parts], axis=1) for name in ("ends", "bodies")),
        *(np.concatenate([getattr(p, name) for p in parts]) for name in ("stiffness", "rest_length", "strength")),
    )


def bound_springs(springs: Springs, mesh: LevelMesh, start: np.ndarray) -> tuple[BoundSprings, ...]:
    """The springs on a level whose points are at `start` (n, d) [m] at t = 0, as one `BoundSprings`; none where there
    are no springs.
    """
    if len(springs.stiffness) == 0:
        return ()
    cells, weights = nearest_material(mesh, np.concatenate(springs.ends), springs.bodies.ravel())
    points = np.hstack(np.split(mesh.cells[cells], 2))
    begins, ends = np.split(weights, 2)
    weights = np.hstack([-begins, ends])
    lengths = np.linalg.norm(np.einsum("ka,kai->ki", weights, start[points]), axis=1)
    rest = np.where(np.isnan(springs.rest_length), lengths, springs.rest_length)
    return (BoundSprings(points, weights, springs.stiffness, rest, springs.strength),)
