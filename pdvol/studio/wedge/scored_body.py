"""What scores ask of a stored run: a level, the bodies on it by name, their centres, turns and distances."""

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.crossings import edges_of
from pdvol.geometry.distances import distances_to
from pdvol.geometry.rigid_motions import rigid_motions
from pdvol.levels.function_check import shape_points
from pdvol.measure.meeting import overlapping_boxes
from pdvol.runs.scene_file import Shot
from pdvol.scene.motions import rotation_matrix
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel


def at_level(run: Run, level: int) -> Run:
    """The same run without its levels above `level`: scores look at the finest level."""
    if not 0 <= level < len(run.levels):
        raise InputError(f"{run.path} has no level {level}; there are 0 to {len(run.levels) - 1}")
    seen = copy.copy(run)
    seen.levels = run.levels[: level + 1]
    return seen


def not_simulated(shot: Shot) -> Run:
    """A shot as a run of no step: what scores ask of it, before they look at states, is what a run will have."""
    scene, level = shot.scene, SimpleNamespace(steps=0, rest=shape_points(shot.scene.bodies[0])[:0], log=())
    info = {"bodies": [body.name for body in scene.bodies], "steps": scene.steps, "diagonal": 1.0}
    info["description"] = shot.description()
    obstacles = [SimpleNamespace(name=obstacle.name, kind="") for obstacle in scene.obstacles]
    run: Any = SimpleNamespace(path=shot.name, info=info, dt=scene.dt, levels=[level], obstacles=obstacles)
    return run


def is_whole_run(run: Run) -> bool:
    """Whether the finest level has all its steps."""
    return run.levels[-1].steps > run.info["steps"]


def contact_distance(run: Run) -> float:
    """dhat [m]: the distance at which contact begins to push.

    Raises
    ------
    InputError
        The run's scene has no contact, or its description was not stored.
    """
    contacts = run.info.get("description", {}).get("contact", [])
    dhat = next((c["dhat"] for c in contacts if c.get("type") == "Barrier"), None)
    if dhat is None:
        raise InputError(f"{run.path}: its scene has no contact; add contact=(Barrier(),) to score what touches")
    return dhat["fraction"] * run.info["diagonal"] if isinstance(dhat, dict) else float(dhat)


@dataclass(frozen=True, eq=False)
class ScoredBody:
    """One body, or all of them, on the finest level of a run.

    Attributes
    ----------
    run : Run
    index : the body's, -1 for all bodies together
    """

    run: Run
    index: int

    @classmethod
    def named(cls, run: Run, name: str | None) -> "ScoredBody":
        """The body of this name; all bodies where it is None.

        Raises
        ------
        InputError
            No body has this name; the message lists the names.
        """
        names = run.info["bodies"]
        if name is not None and name not in names:
            raise InputError(f"{run.path}: there is no body {name!r}; there are {', '.join(names)}")
        return cls(run, -1 if name is None else names.index(name))

    @property
    def level(self) -> RunLevel:
        """The level looked at."""
        return self.run.levels[-1]

    @cached_property
    def vertices(self) -> np.ndarray:
        """(k,) int64: its vertices."""
        return np.flatnonzero((self.level.mesh.point_bodies == self.index) | (self.index < 0))

    @cached_property
    def cells(self) -> np.ndarray:
        """(m, d + 1) int64: its cells, in the level's numbering."""
        mesh = self.level.mesh
        return mesh.cells[(mesh.bodies == self.index) | (self.index < 0)]

    @cached_property
    def facets(self) -> np.ndarray:
        """(f, d) int64: its boundary facets, in the level's numbering."""
        owners = self.level.mesh.point_bodies[self.level.surface[:, 0]]
        return self.level.surface[(owners == self.index) | (self.index < 0)]

    @cached_property
    def weights(self) -> np.ndarray:
        """(k,) fractions of the volume in the rest shape: the weights of its vertices in means. They sum to one."""
        mesh = self.level.mesh
        lumped = np.bincount(mesh.cells.ravel(), np.repeat(mesh.volumes, mesh.dim + 1), len(mesh.points))
        return lumped[self.vertices] / lumped[self.vertices].sum()

    @property
    def size(self) -> float:
        """[m] the diagonal of the box around it at rest."""
        return float(np.linalg.norm(np.ptp(self.level.rest[self.vertices], axis=0)))

    def centre(self, step: int) -> np.ndarray:
        """(d,) [m]: its centre of volume."""
        return self.weights @ self.level.positions(step)[self.vertices]

    def rotation(self, step: int) -> np.ndarray:
        """(d, d): the rotation that takes it from rest to a step best."""
        rest, now = self.level.rest[self.vertices], self.level.positions(step)[self.vertices]
        return rigid_motions(rest, now, self.weights, np.zeros(len(rest), dtype=np.int64)).rotations[0]

    def placed_direction(self, direction: np.ndarray) -> np.ndarray:
        """(d,) a direction of the body's shape as the scene's placement has turned it."""
        bodies = self.run.info.get("description", {}).get("bodies", [])
        if len(bodies) <= self.index:
            raise InputError(f"{self.run.path}: the placement of its bodies was not stored; leave the axis out")
        placement = bodies[self.index]["placement"]
        return rotation_matrix(placement["angle"], placement["axis"], len(direction)) @ direction

    def gaps(self, others: "list[ScoredBody | DrawnObstacle]") -> Iterator[float]:
        """[m] at each stored step the smallest distance to any of the others."""
        for step in range(self.level.steps):
            positions = self.level.positions(step)
            yield min((self._gap(positions, other, step) for other in others), default=np.inf)

    def _gap(self, positions: np.ndarray, other: "ScoredBody | DrawnObstacle", step: int) -> float:
        if isinstance(other, ScoredBody):
            return surface_gap(positions, self.facets, positions, other.facets)
        number = next(i for i, obstacle in enumerate(self.run.obstacles) if obstacle is other)
        placed = self.level.placed(self.run.obstacles, step)[number]
        if placed.kind == "plane":
            point, normal = placed.plane(step)
            return float(((positions[self.vertices] - point) @ normal).min())
        return surface_gap(
            positions, self.facets, placed.vertices(step), placed.arrays["faces" if placed.kind == "mesh" else "edges"]
        )


def surface_gap(points: np.ndarray, facets: np.ndarray, other_points: np.ndarray, other_facets: np.ndarray) -> float:
    """[m] the smallest distance between two boundaries, which do not cross: triangles (k, 3) in 3D, edges (k, 2) in 2D.

    Parameters
    ----------
    points, other_points : (n, d) [m]
    facets, other_facets : (k, d) corners of each facet
    """
    there = distances_to(points[np.unique(facets)], other_points, other_facets)
    back = distances_to(other_points[np.unique(other_facets)], points, facets)
    gap = float(min(there.min(), back.min()))
    if points.shape[1] == 2:
        return gap
    one, other = points[edges_of(facets)], other_points[edges_of(other_facets)]
    grown = [(ends.min(1) - gap / 2, ends.max(1) + gap / 2) for ends in (one, other)]
    pairs = overlapping_boxes(*grown[0], *grown[1])
    if len(pairs) == 0:
        return gap
    return min(gap, float(segment_gaps(one[pairs[:, 0]], other[pairs[:, 1]]).min()))


def segment_gaps(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(k,) [m]: distances of k pairs of segments (k, 2, d), given by their ends.

    The closest points are at the lines' closest points, moved into both segments in turn (Ericson 2005, section 5.1.9).
    """
    d1, d2, r = one[:, 1] - one[:, 0], other[:, 1] - other[:, 0], one[:, 0] - other[:, 0]
    a, b, e = (np.einsum("kd,kd->k", u, v) for u, v in ((d1, d1), (d1, d2), (d2, d2)))
    c, f = (np.einsum("kd,kd->k", u, r) for u in (d1, d2))
    a, e = np.maximum(a, np.finfo(float).tiny), np.maximum(e, np.finfo(float).tiny)
    denominator = a * e - b * b
    parallel = denominator <= 1e-12 * a * e
    s = np.where(parallel, 0.0, np.clip((b * f - c * e) / np.where(parallel, 1.0, denominator), 0.0, 1.0))
    t = (b * s + f) / e
    s = np.where(t < 0.0, np.clip(-c / a, 0.0, 1.0), np.where(t > 1.0, np.clip((b - c) / a, 0.0, 1.0), s))
    t = np.clip(t, 0.0, 1.0)
    return np.linalg.norm(r + s[:, None] * d1 - t[:, None] * d2, axis=1)
