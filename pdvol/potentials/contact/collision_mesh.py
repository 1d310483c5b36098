"""The collision mesh that ipctk takes, with its edges oriented alike and scaled down where edges are compressed."""

import ipctk
import numpy as np

REFERENCE_DIRECTION = np.array([0.5377, 0.3121, 0.7832])
"""Direction (no unit) with which all edges are oriented alike: few meshes have many edges at right angles to it.

The convergent collision set of ipctk 1.6.1 identifies the parts of a pair of nearly parallel edges by a name (edge a
with end 0 of edge b, say), and takes the parts of (a, b) and (b, a) with the same name for one. If a and b have
opposite directions these are two different parts: one of them is lost, and the energy jumps when the other appears or
vanishes. Nearly parallel edges of the same direction have no two parts with one name within dhat. ipctk decides what is
nearly parallel by the edges' lengths at rest: of edges compressed to a quarter, pairs at 30 degrees count as nearly
parallel.
"""

# ratio of an edge's length at rest to its current one: beyond it ipctk's mesh is scaled down, for the reason above
MAX_COMPRESSION = 2.0
# ratio of the scaled mesh to the true one: edges compressed to an eighth then count as nearly parallel below 7 degrees,
# uncompressed ones below 0.1 degrees; at smaller scales kinks in the energy become visible
COMPRESSED_SCALE = 0.25


class CollisionMesh:
    """Vertices, edges and faces of bodies and obstacles, as an `ipctk.CollisionMesh`.

    Parameters
    ----------
    vertices : (n, d) positions at rest [m]
    edges : (e, 2) int
    faces : (f, 3) int, none in 2D
    own : number of this rank's own vertices, which come first; pairs without any of them are left out

    Attributes
    ----------
    ipc : ipctk.CollisionMesh
        Replaced whenever edges are reversed or the scale changes.
    scale : ratio of its size at rest to the true one, a power of two, so that its areas are exactly scale**2 of the
        true ones
    edges, faces : int64
        Vertices of each primitive, in the order in which ipctk has them.
    """

    def __init__(self, vertices: np.ndarray, edges: np.ndarray, faces: np.ndarray, own: int):
        self._at_rest, self._own = np.asfortranarray(vertices), own
        self._given, self._reversed = edges.astype(np.int64), np.zeros(len(edges), dtype=bool)
        self.edges, self.faces, self.scale = self._given, faces.astype(np.int64), 1.0
        self._make()

    def _make(self) -> None:
        integers = (np.asfortranarray(primitives, dtype=np.int32) for primitives in (self.edges, self.faces))
        self.ipc = ipctk.CollisionMesh(self.scale * self._at_rest, *integers)
        # ipctk lets no two static vertices collide. All but this rank's own are static here: their pairs belong to
        # other ranks.
        self.ipc.can_collide = ipctk.make_static_obstacle_filter(self._own)

    def orient_edges(self, vertices: np.ndarray, edges: np.ndarray | None = None) -> None:
        """Orients edges alike at the positions `vertices` (n, 3) [m], and scales the mesh down where an edge is
        compressed.

        The result for the given edges is a function of the positions alone. The other edges may keep an older
        orientation, which spares a new mesh.

        Parameters
        ----------
        edges : (k,) int
            Edges that must be oriented; all where not given.
        """
        current, at_rest = (
            points[self._given[:, 1]] - points[self._given[:, 0]] for points in (vertices, self._at_rest)
        )
        compressed = np.any(np.linalg.norm(at_rest, axis=1) > MAX_COMPRESSION * np.linalg.norm(current, axis=1))
        reversed_, scale = current @ REFERENCE_DIRECTION < 0.0, COMPRESSED_SCALE if compressed else 1.0
        changed = reversed_ != self._reversed
        if scale != self.scale or np.any(changed if edges is None else changed[edges]):
            self._reversed, self.scale = reversed_, scale
            self.edges = np.where(reversed_[:, None], self._given[:, ::-1], self._given)
            self._make()
