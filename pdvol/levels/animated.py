"""Point caches on a level: vertices matched to an animated mesh, their places at a time, and velocities that a body
takes over.

A vertex X is matched to the nearest point y of the animated mesh in its first frame. It follows that material point,
and keeps its offset X - y, which turns with the facet that y lies on. So meshes of other levels, which end short of the
animated one or beyond it, follow the same animation.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation as Turn

from pdvol.errors import InputError
from pdvol.geometry.boundary_search import enclosed, nearest_points
from pdvol.geometry.rigid_motions import best_rotations
from pdvol.meshing.point_caches import Frames, read_frames
from pdvol.scene import Motion, PointCache, TakeOver

LEAST_FILLED = 0.1  # of a cache's diagonal, of what lies inside it: in other units it would be smaller


@dataclass(frozen=True, eq=False)
class Matched:
    """Vertices on an animated mesh.

    Attributes
    ----------
    corners : (n, c) int64
        The points of the facet that each vertex follows; one where the mesh has no facets.
    weights : (n, c)
        Barycentric coordinates there, none negative, rows sum to one.
    offsets : (n, d) [m], from the point on the facet to the vertex
    """

    corners: np.ndarray
    weights: np.ndarray
    offsets: np.ndarray

    def on(self, values: np.ndarray) -> np.ndarray:
        """(n, ...) values of the animated mesh's points (m, ...), at the vertices' places on it."""
        return np.einsum("nc,nc...->n...", self.weights, values[self.corners])


def cached_motion(motion: PointCache, vertices: np.ndarray, whose: str) -> Motion:
    """The motion of vertices (n, d) at rest, which are matched to the first frame of a point cache, with their offsets
    in the bases of their facets. What it encloses, as a hand's skin does, may be at any depth.

    Raises
    ------
    InputError
        The cache cannot be read, has another dimension, or vertices are too far from it; `whose` names them, as in "a
        support".
    """
    frames = read_frames(motion)
    matched = _matched(motion, frames, 0, vertices, whose, encloses=True)
    rows, corners = np.unique(matched.corners, return_inverse=True)
    corners = corners.reshape(matched.corners.shape)
    local = np.einsum("nij,ni->nj", _bases(frames.frame(0)[rows][corners]), matched.offsets)

    def follow(X: np.ndarray, t: float) -> np.ndarray:
        facets = frames.at(t, rows)[corners]
        return np.einsum("nc,ncd->nd", matched.weights, facets) + np.einsum("nij,nj->ni", _bases(facets), local)

    return follow


def taken_velocity(taken: TakeOver, points: np.ndarray, on_surface: np.ndarray, whose: str) -> np.ndarray:
    """(n, d) [m/s]: the velocities that a body takes over at points (n, d); those on its surface (n,) bool must be near
    the animation's last frame.

    Raises
    ------
    InputError
        As `cached_motion`, or the cache has one frame alone.
    """
    cache, frames = taken.cache, read_frames(taken.cache)
    if len(frames.times) < 2:
        raise InputError(f"{whose}: {cache.label} has one frame, which has no velocity; give two at least")
    last = len(frames.times) - 1
    _matched(cache, frames, last, points[on_surface], whose)
    used = range(max(0, last - 2), last + 1)
    places = [frames.frame(k) for k in used]
    powers = np.vander(frames.times[list(used)] - frames.times[last], increasing=True)  # of polynomials sum_j a_j t^j
    slope = np.linalg.inv(powers)[1]  # a_1, that at the last frame of the polynomial through them
    velocity = sum((s * place for s, place in zip(slope, places, strict=True)), np.zeros(1))
    if not taken.rigid:
        return nearest_on(places[-1], frames.faces, points).on(velocity)
    before, after = (place - place.mean(axis=0) for place in places[-2:])
    (turn,) = best_rotations((after.T @ before)[None])
    duration, relative = frames.times[last] - frames.times[last - 1], points - places[-1].mean(axis=0)
    if points.shape[1] == 2:
        spin = np.arctan2(turn[1, 0], turn[0, 0]) / duration
        return velocity.mean(axis=0) + spin * np.column_stack([-relative[:, 1], relative[:, 0]])
    return velocity.mean(axis=0) + np.cross(Turn.from_matrix(turn).as_rotvec() / duration, relative)


def _matched(
    cache: PointCache, frames: Frames, frame: int, vertices: np.ndarray, whose: str, encloses: bool = False
) -> Matched:
    """Vertices matched to a frame of a cache; raises InputError where one is further away than the tolerance, and not
    inside the cache where that `encloses` what it moves.
    """
    points = frames.frame(frame)
    if points.shape[1] != vertices.shape[1]:
        raise InputError(
            f"{whose} is {vertices.shape[1]}D, and {cache.label} {points.shape[1]}D; give the same for both"
        )
    if np.array_equal(points, vertices):  # also where parts of the mesh touch each other
        own = np.arange(len(points))[:, None]
        return Matched(own, np.ones(own.shape), np.zeros(points.shape))
    found = nearest_on(points, frames.faces, vertices)
    distances = np.linalg.norm(found.offsets, axis=1)
    size = np.linalg.norm(np.ptp(points, axis=0))
    limit = cache.tolerance * size
    far = np.flatnonzero(distances > limit)
    if encloses and len(far) and len(frames.faces) and np.linalg.norm(np.ptp(vertices, axis=0)) > LEAST_FILLED * size:
        far = far[~enclosed(vertices[far], points, frames.faces)]
    if len(far):
        worst = far[np.argmax(distances[far])]
        place = ", ".join(f"{x:.4g}" for x in vertices[worst])
        raise InputError(
            f"{whose}: {len(far):,} of {len(vertices):,} vertices are further than {limit:.3g} m from {cache.label} in"
            f" frame {frame}, as the one at ({place}), {distances[worst]:.3g} m; narrow `where`, move the cache by its"
            " placement, or raise PointCache.tolerance"
        )
    return found


def nearest_on(points: np.ndarray, faces: np.ndarray, vertices: np.ndarray) -> Matched:
    """The nearest point of a mesh to each vertex."""
    if len(faces) == 0:
        corners = cKDTree(points).query(vertices)[1][:, None]
        return Matched(corners, np.ones(corners.shape), vertices - points[corners[:, 0]])
    facet, places = nearest_points(points, faces, vertices)
    corners = faces[facet]
    first, *others = points[corners].swapaxes(0, 1)
    edges = np.stack(others, axis=1) - first[:, None]
    products = np.einsum("nad,nbd->nab", edges, edges)
    fractions = np.einsum("nab,nbd,nd->na", np.linalg.pinv(products), edges, places - first).clip(0.0, 1.0)
    weights = np.column_stack([1.0 - fractions.sum(axis=1), fractions]).clip(0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    return Matched(corners, weights, vertices - np.einsum("nc,ncd->nd", weights, points[corners]))


def _bases(facets: np.ndarray) -> np.ndarray:
    """(n, d, d): an orthonormal basis of each facet (n, c, d), in columns; the axes where a facet has no direction."""
    n, corners, dim = facets.shape
    bases = np.tile(np.eye(dim), (n, 1, 1))
    if corners < dim:
        return bases
    along = facets[:, 1] - facets[:, 0]
    size = np.linalg.norm(along, axis=1)
    if dim == 2:
        good = size > 0.0
        one = along[good] / size[good, None]
        bases[good] = np.stack([one, np.column_stack([-one[:, 1], one[:, 0]])], axis=2)
        return bases
    normal = np.cross(along, facets[:, 2] - facets[:, 0])
    height = np.linalg.norm(normal, axis=1)
    good = (size > 0.0) & (height > 0.0)
    one, up = along[good] / size[good, None], normal[good] / height[good, None]
    bases[good] = np.stack([one, np.cross(up, one), up], axis=2)
    return bases
