"""Candidate pairs of primitives, found by one broad phase and kept while no vertex moves far (a Verlet list).

While every vertex stays within a distance `slack` of its place at the search, two primitives approach each other by
2 slack at most. The pairs nearer than the reach plus 2 slack at the search therefore contain all pairs in contact, and
all collisions on the way. A longer straight move gets a list of its own, from the boxes that it sweeps, which holds for
every point of that move.

The broad phase compares bounding boxes. Boxes of edges in one flat face overlap although the edges are far apart, so
about four of five pairs of edges are dropped again by their true distance.
"""

from itertools import compress

import ipctk
import numpy as np

from pdvol.geometry.closest_points import segment_distances
from pdvol.potentials.contact.collision_mesh import CollisionMesh
from pdvol.potentials.contact.stencils import column

# largest slack, in median edge lengths: longer lists cost more in every evaluation than a new search does
MAX_SLACK = 0.2
# smallest slack, in largest slacks: enough for the next moves where no longer ones are expected
MIN_SLACK = 0.15
# slack, in lengths of the move that it is made for: the moves after it are seldom longer
SLACK_PER_MOVE = 1.2
# searched distance, in needed distances: room for round-off, above all in the distances of nearly parallel edges
SEARCH_MARGIN = 1.02
# distance from a straight move that counts as round-off, in largest coordinates
STRAIGHT_TOLERANCE = 1e-12


class ContactCandidates:
    """Candidate pairs of a collision mesh for states and straight moves.

    Parameters
    ----------
    mesh : CollisionMesh
    vertices : (n, d) positions [m] that the slack's size is measured at
    reach : distance [m] up to which pairs matter
    drifts : bool
        Whether to ignore translations common to all vertices: without obstacles they change no distance.

    Attributes
    ----------
    pairs : ipctk.Candidates
    searches : number of broad phases so far
    edges : (k,) int64
        Edges that occur in the candidate pairs of two edges; None where any edge may.
    """

    def __init__(self, mesh: CollisionMesh, vertices: np.ndarray, reach: float, drifts: bool):
        self.mesh, self.reach, self.drifts = mesh, reach, drifts
        starts, ends = vertices[mesh.edges.T]
        self.max_slack = MAX_SLACK * float(np.median(np.linalg.norm(starts - ends, axis=1)))
        self.pairs = ipctk.Candidates()
        self.edges: np.ndarray | None = None
        self.forget()
        self.searches = 0

    def forget(self) -> None:
        """Drops the candidates: the next call starts a new search."""
        self._slack = -1.0
        self._reference: np.ndarray | None = None
        self._move: np.ndarray | None = None

    def begin(self, start: np.ndarray, end: np.ndarray) -> None:
        """Searches for a step that starts at `start` and probably ends near `end` (n, d)."""
        self.forget()
        move = SLACK_PER_MOVE * _largest(self._without_drift(end) - self._without_drift(start))
        if move <= self.max_slack:
            self._search_around(start, max(move, MIN_SLACK * self.max_slack))
            self._drop_far_edges(start)

    def _without_drift(self, vertices: np.ndarray) -> np.ndarray:
        return vertices - vertices.mean(axis=0) if self.drifts else vertices

    def at(self, vertices: np.ndarray) -> ipctk.Candidates:
        """Candidates among which are all pairs nearer than the reach at `vertices` (n, d)."""
        if not self._covers(vertices):
            self._search_around(vertices, MIN_SLACK * self.max_slack)
            self._drop_far_edges(vertices)
        return self.pairs

    def along(self, start: np.ndarray, end: np.ndarray) -> ipctk.Candidates:
        """Candidates among which are all pairs that come nearer than the reach on the straight move from start to end
        (n, d).
        """
        if self._reference is not None and all(
            _largest(self._without_drift(vertices) - self._reference) <= self._slack for vertices in (start, end)
        ):
            return self.pairs
        move = _largest(self._without_drift(end) - self._without_drift(start))
        if SLACK_PER_MOVE * move <= self.max_slack:
            self._search_around(start, max(SLACK_PER_MOVE * move, MIN_SLACK * self.max_slack))
        else:
            self.pairs.build(
                mesh=self.mesh.ipc,
                vertices_t0=start,
                vertices_t1=self._end_without_drift(start, end),
                inflation_radius=0.5 * SEARCH_MARGIN * self.reach,
                broad_phase=ipctk.LBVH(),
            )
            self._reference, self._slack, self._move = (
                self._without_drift(start),
                0.0,
                self._without_drift(end) - self._without_drift(start),
            )
            self.edges = None
            self.searches += 1
        return self.pairs

    def _end_without_drift(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        return np.asfortranarray(end + (start.mean(axis=0) - end.mean(axis=0))) if self.drifts else end

    def _covers(self, vertices: np.ndarray) -> bool:
        if self._reference is None:
            return False
        offset = self._without_drift(vertices) - self._reference
        if _largest(offset) <= self._slack:
            return True
        if self._move is None:
            return False
        share = float(np.vdot(offset, self._move) / max(np.vdot(self._move, self._move), 1e-300))
        return (
            0.0 <= share <= 1.0 + STRAIGHT_TOLERANCE
            and _largest(offset - share * self._move) <= STRAIGHT_TOLERANCE * np.abs(vertices).max()
        )

    def _search_around(self, vertices: np.ndarray, slack: float) -> None:
        # Both boxes of a pair are inflated by the radius: half the distance each.
        self.pairs.build(
            mesh=self.mesh.ipc,
            vertices=vertices,
            inflation_radius=0.5 * self._search_distance(slack),
            broad_phase=ipctk.LBVH(),
        )
        self._reference, self._slack, self._move = self._without_drift(vertices).copy(), slack, None
        self.edges = None
        self.searches += 1

    def _search_distance(self, slack: float) -> float:
        return SEARCH_MARGIN * (self.reach + 2.0 * slack)

    def _drop_far_edges(self, vertices: np.ndarray) -> None:
        """Drops pairs of edges farther apart than the searched distance at the vertices (n, d) of the search.

        It costs as much as three evaluations of all pairs. Lists for a single long move are seldom used that often and
        are left as they are.
        """
        found = self.pairs.ee_candidates
        pairs = [column(found, name, np.int64) for name in ("edge0_id", "edge1_id")]
        ends = (vertices[self.mesh.edges[edges, end]] for edges in pairs for end in (0, 1))
        kept = segment_distances(*ends) <= self._search_distance(self._slack)
        self.pairs.ee_candidates = list(compress(found, kept))
        self.edges = np.unique(np.concatenate([edges[kept] for edges in pairs]))


def _largest(rows: np.ndarray) -> float:
    return float(np.sqrt(np.max(np.einsum("ij,ij->i", rows, rows), initial=0.0)))
