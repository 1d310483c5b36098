"""The primitives that may touch, as ipctk's mesh, with edges that run alike, also where they are crushed."""

import ipctk
import numpy as np

ALIKE = np.array([0.5377, 0.3121, 0.7832])
"""What edges' directions are compared with: one that few meshes have many edges at right angles to.

The convergent set of ipctk 1.6.1 keeps the parts of a pair of nearly parallel edges apart by their names (edge a with
end 0 of b, say), and takes (a, b) and (b, a) of one name for the same part. Where a and b run against each other these
are two, one of them is lost, and the energy jumps by it when the other comes or goes. Edges that run alike have no two
parts of one name within reach, while nearly parallel means a few degrees. ipctk measures that by edges' lengths at
rest: of edges crushed to a quarter, pairs at 30 degrees count as nearly parallel.
"""

CRUSHED = 2.0  # times as long at rest as now: where an edge is, ipctk's mesh is drawn smaller
# of its size: pairs of edges crushed to an eighth then fade below 7 degrees, of others below 0.1, where kinks begin to
# tell
SMALLER = 0.25


class CollisionMesh:
    """Vertices, edges and faces of bodies and obstacles.

    Parameters
    ----------
    vertices : (n, d) positions at rest [m]
    edges : (e, 2) int
    faces : (f, 3) int, none in 2D
    own : pairs of which no vertex is among the first `own` are left out

    Attributes
    ----------
    ipc : ipctk.CollisionMesh
        Another one each time that edges turned round or were crushed further.
    scale : its size at rest over the true one; its areas are scale**2 of the true ones, to the last bit
    edges, faces : int64
        As ipctk has them.
    """

    def __init__(self, vertices: np.ndarray, edges: np.ndarray, faces: np.ndarray, own: int):
        self._at_rest, self._own = np.asfortranarray(vertices), own
        self._given, self._turned = edges.astype(np.int64), np.zeros(len(edges), dtype=bool)
        self.edges, self.faces, self.scale = self._given, faces.astype(np.int64), 1.0
        self._make()

    def _make(self) -> None:
        integers = (np.asfortranarray(primitives, dtype=np.int32) for primitives in (self.edges, self.faces))
        self.ipc = ipctk.CollisionMesh(self.scale * self._at_rest, *integers)
        # What ipctk calls static vertices do not meet each other: all beyond this rank's own, whose pairs are other
        # ranks'.
        self.ipc.can_collide = ipctk.make_static_obstacle_filter(self._own)

    def align(self, vertices: np.ndarray, edges: np.ndarray | None = None) -> None:
        """Turns edges round, in this mesh alone, until at `vertices` (n, 3) all that matter run alike, and draws it
        smaller where edges are crushed. What it makes of those that matter is a function of the positions alone.

        Parameters
        ----------
        edges : (k,) int
            Those that matter; all where not given.
        """
        along, at_rest = (points[self._given[:, 1]] - points[self._given[:, 0]] for points in (vertices, self._at_rest))
        crushed = np.any(np.linalg.norm(at_rest, axis=1) > CRUSHED * np.linalg.norm(along, axis=1))
        turned, scale = along @ ALIKE < 0.0, SMALLER if crushed else 1.0
        changed = turned != self._turned
        if scale != self.scale or np.any(changed if edges is None else changed[edges]):
            self._turned, self.scale = turned, scale
            self.edges = np.where(turned[:, None], self._given[:, ::-1], self._given)
            self._make()
