"""Which pairs of primitives can touch: found by one broad phase and kept for as long as nothing has moved far.

While every vertex stays within `slack` of where it was, two primitives come nearer by 2 slack at most: all pairs nearer
than the reach plus 2 slack then are all that contact, or a collision on the way, can be about (a Verlet list). Longer
moves get a list of their own, from the boxes they sweep, good for any point of that straight move.

The search goes by boxes, and those of edges of one flat face meet without the edges being near: four of five pairs of
edges are dropped again.
"""

from itertools import compress

import ipctk
import numpy as np

from pdvol.geometry.closest_points import segment_distances
from pdvol.potentials.contact.collision_mesh import CollisionMesh
from pdvol.potentials.contact.pair_arrays import column

# of the median edge: longer slacks catch so many neighbours that looking through them costs more than searching anew
NEAR = 0.2
SHORTEST = 0.15  # of the longest slack: what is allowed for where nothing is known to move
ROOM = 1.2  # slack over the move that asked for it
ROUND = 1.02  # times the distance that is asked for: what is searched for
ALONG = 1e-12  # of the largest coordinate: distance from a straight move that is round-off


class ContactCandidates:
    """Candidate pairs of a collision mesh for states and straight moves.

    Parameters
    ----------
    mesh : CollisionMesh
    reach : distance [m] up to which pairs matter
    drifts : bool
        Whether nothing stands still, so that a translation common to all vertices changes no distance.

    Attributes
    ----------
    searches : how many there were
    edges : (k,) int64
        Edges of which pairs of edges may consist; None where that may be any.
    """

    def __init__(self, mesh: CollisionMesh, vertices: np.ndarray, reach: float, drifts: bool):
        self.mesh, self.reach, self.drifts = mesh, reach, drifts
        starts, ends = vertices[mesh.edges.T]
        self._longest = NEAR * float(np.median(np.linalg.norm(starts - ends, axis=1)))
        self.pairs, self.edges = ipctk.Candidates(), None
        self.forget()
        self.searches = 0

    def forget(self) -> None:
        """The next call searches anew."""
        self._slack, self._reference, self._move = -1.0, None, None

    def begin(self, start: np.ndarray, end: np.ndarray) -> None:
        """Searches anew for a step that probably goes from start to about end (k, d)."""
        self.forget()
        move = ROOM * _largest(self._place(end) - self._place(start))
        if move <= self._longest:
            self._search_around(start, max(move, SHORTEST * self._longest))
            self._drop_far_edges(start)

    def _place(self, vertices: np.ndarray) -> np.ndarray:
        return vertices - vertices.mean(axis=0) if self.drifts else vertices

    def _strays(self, vertices: np.ndarray) -> float:
        return _largest(self._place(vertices) - self._reference)

    def at(self, vertices: np.ndarray) -> ipctk.Candidates:
        """Candidates among which are all pairs nearer than the reach at `vertices` (k, d)."""
        if not self._knows(vertices):
            self._search_around(vertices, SHORTEST * self._longest)
            self._drop_far_edges(vertices)
        return self.pairs

    def along(self, start: np.ndarray, end: np.ndarray) -> ipctk.Candidates:
        """Candidates among which are all pairs that come nearer than the reach on the straight way from start to end
        (k, d).
        """
        if self._reference is not None and max(self._strays(start), self._strays(end)) <= self._slack:
            return self.pairs
        move = _largest(self._place(end) - self._place(start))
        if ROOM * move <= self._longest:
            self._search_around(start, max(ROOM * move, SHORTEST * self._longest))
        else:
            self.pairs.build(
                mesh=self.mesh.ipc,
                vertices_t0=start,
                vertices_t1=self._beside(start, end),
                inflation_radius=0.5 * ROUND * self.reach,
                broad_phase=ipctk.LBVH(),
            )
            self._reference, self._slack, self._move = self._place(start), 0.0, self._place(end) - self._place(start)
            self.edges = None
            self.searches += 1
        return self.pairs

    def _beside(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        return np.asfortranarray(end + (start.mean(axis=0) - end.mean(axis=0))) if self.drifts else end

    def _knows(self, vertices: np.ndarray) -> bool:
        if self._reference is None:
            return False
        offset = self._place(vertices) - self._reference
        if _largest(offset) <= self._slack:
            return True
        if self._move is None:
            return False
        share = float(np.vdot(offset, self._move) / max(np.vdot(self._move, self._move), 1e-300))
        return 0.0 <= share <= 1.0 + ALONG and _largest(offset - share * self._move) <= ALONG * np.abs(vertices).max()

    def _search_around(self, vertices: np.ndarray, slack: float) -> None:
        # Boxes are inflated by the radius each.
        self.pairs.build(
            mesh=self.mesh.ipc, vertices=vertices, inflation_radius=0.5 * self._near(slack), broad_phase=ipctk.LBVH()
        )
        self._reference, self._slack, self._move = self._place(vertices).copy(), slack, None
        self.edges = None
        self.searches += 1

    def _near(self, slack: float) -> float:
        return ROUND * (self.reach + 2.0 * slack)

    def _drop_far_edges(self, vertices: np.ndarray) -> None:
        """Leaves only pairs of edges that are as near as was searched for, at the vertices (k, d) that were searched
        around: as dear as going through all of them three times, which lists made for a single move often do not live
        to see.
        """
        found = self.pairs.ee_candidates
        pairs = [column(found, name, np.int64) for name in ("edge0_id", "edge1_id")]
        ends = (vertices[self.mesh.edges[edges, end]] for edges in pairs for end in (0, 1))
        kept = segment_distances(*ends) <= self._near(self._slack)
        self.pairs.ee_candidates = list(compress(found, kept))
        self.edges = np.unique(np.concatenate([edges[kept] for edges in pairs]))


def _largest(rows: np.ndarray) -> float:
    return float(np.sqrt(np.max(np.einsum("ij,ij->i", rows, rows), initial=0.0)))
