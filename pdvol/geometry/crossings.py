"""Primitives that cross or touch: the boxes' overlaps come from ipctk's broad phase, the decision from closed (touching
counts) tests here.

Written apart from the solver's contact code, so that it can judge it. In 3D an edge crosses a triangle when its ends
lie on different sides and its line passes through; in 2D two edges cross. Parallel contact, which has no such crossing,
is found as a distance below `TOUCHING_DISTANCE` times the size.
"""

import numpy as np

COPLANAR = 1e-12
"""Volume of a parallelepiped, relative to the product of its edge lengths, below which its corners are coplanar."""
TOUCHING_DISTANCE = 1e-10
"""Distance, relative to the size of bodies, below which two primitives touch: no barrier is finite there."""
LAST_BITS = 1e-15
"""The same, relative to the largest coordinate: a few of its last bits."""


def edges_of(faces: np.ndarray) -> np.ndarray:
    """Unique edges (e, 2) of facets: triangles (k, 3), or edges (k, 2), which are their own."""
    if faces.shape[1] == 2:
        return faces
    return counted_edges(faces)[0]


def counted_edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unique edges (e, 2) int64 of triangles (k, 3), sorted; which of them each triangle's sides are (3 k,), in turn;
    and how many triangles have each (e,).
    """
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64), axis=1)
    stride = int(sides.max()) + 1 if len(sides) else 1
    # one number for a pair: unique rows take twenty times as long
    keys, which, counts = np.unique(sides[:, 0] * stride + sides[:, 1], return_inverse=True, return_counts=True)
    return np.column_stack(np.divmod(keys, stride)), which.ravel(), counts


def find_crossings(
    points: np.ndarray, edges: np.ndarray, faces: np.ndarray, groups: np.ndarray | None = None
) -> np.ndarray:
    """Pairs of primitives without a common vertex that cross.

    Parameters
    ----------
    points : (n, d) float64 [m]
    edges : (e, 2) integer
    faces : (f, 3) integer; empty in 2D
    groups : (n,) integer, optional
        Pairs of vertices with the same negative group are not tested (obstacles among themselves).

    Returns
    -------
    (k, 2) int64: (edge, edge) in 2D, (edge, face) in 3D, sorted.
    """
    if len(edges) == 0:
        return np.empty((0, 2), dtype=np.int64)
    second = edges if points.shape[1] == 2 else faces
    import ipctk

    phase = ipctk.LBVH()
    phase.build(*fortran(points, edges, faces))
    if points.shape[1] == 2:
        found = [(c.edge0_id, c.edge1_id) for c in phase.detect_edge_edge_candidates()]
    else:
        found = [(c.edge_id, c.face_id) for c in phase.detect_edge_face_candidates()]
    pairs = np.array(found, dtype=np.int64).reshape(-1, 2)
    if groups is not None and len(pairs):
        a, b = groups[edges[pairs[:, 0], 0]], groups[second[pairs[:, 1], 0]]
        pairs = pairs[~((a < 0) & (b < 0))]
    if len(pairs):
        shared = (edges[pairs[:, 0]][:, :, None] == second[pairs[:, 1]][:, None, :]).any(axis=(1, 2))
        pairs = pairs[~shared]
    if len(pairs):
        test = _segments_meet if points.shape[1] == 2 else _segment_meets_triangle
        pairs = pairs[test(points[edges[pairs[:, 0]]], points[second[pairs[:, 1]]])]
    return pairs[np.lexsort(pairs.T[::-1])]


def find_touching(
    points: np.ndarray,
    edges: np.ndarray,
    faces: np.ndarray,
    groups: np.ndarray | None = None,
    size: float | None = None,
) -> np.ndarray:
    """Pairs of vertices (k, 2) int64, one of each primitive, whose primitives are nearer than `TOUCHING_DISTANCE` times
    `size` [m] (the diagonal where it is not given), or so near that round-off hides their distance.
    """
    import ipctk

    vertices, lines, triangles = fortran(points, edges, faces)
    mesh = ipctk.CollisionMesh(rest_positions=vertices, edges=lines, faces=triangles)
    size = float(np.linalg.norm(np.ptp(points, axis=0))) if size is None else size
    tolerance = max(TOUCHING_DISTANCE * size, LAST_BITS * float(np.abs(points).max()))
    near = ipctk.NormalCollisions()
    near.build(mesh=mesh, vertices=vertices, dhat=tolerance)
    found = []
    for k in range(len(near)):
        ids = [i for i in near[k].vertex_ids(lines, triangles) if i >= 0]
        # Vertex-face and vertex-edge collisions name the vertex first; edge-edge ones the first edge's two ends.
        found.append((ids[0], ids[-1]))
    pairs: np.ndarray = np.array(found, dtype=np.int64).reshape(-1, 2)
    if groups is not None and len(pairs):
        pairs = pairs[~((groups[pairs[:, 0]] < 0) & (groups[pairs[:, 1]] < 0))]
    return pairs


def fortran(points: np.ndarray, edges: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, edges and faces as ipctk takes them."""
    return (
        np.asarray(points, dtype=np.float64, order="F"),
        np.asarray(edges, dtype=np.int32, order="F").reshape(-1, 2, order="F"),
        np.asarray(faces, dtype=np.int32, order="F").reshape(-1, 3, order="F"),
    )


def _segments_meet(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Mask (k,) of the segment pairs (k, 2, 2) that meet. Collinear overlap is left to `find_touching`."""

    def side(line: np.ndarray, point: np.ndarray) -> np.ndarray:
        u, w = line[:, 1] - line[:, 0], point - line[:, 0]
        return np.sign(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0])

    a0, a1 = side(first, second[:, 0]), side(first, second[:, 1])
    b0, b1 = side(second, first[:, 0]), side(second, first[:, 1])
    flat = (a0 == 0) & (a1 == 0)
    return (a0 * a1 <= 0) & (b0 * b1 <= 0) & ~flat


def _segment_meets_triangle(segment: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """Mask (k,) of the segments (k, 2, 3) that meet their triangle (k, 3, 3). Coplanar overlap is left to
    `find_touching`.

    Flat patches of scaled and turned meshes are coplanar to round-off only, which grows with the distance from the
    origin: the sign of such a volume is noise and counts as zero.
    """
    bits = LAST_BITS * max(float(np.abs(segment).max()), float(np.abs(triangle).max()))

    def volume(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
        u, v, w = b - a, c - a, d - a
        value = np.einsum("ij,ij->i", np.cross(u, v), w)
        x, y, z = (np.linalg.norm(side, axis=1) for side in (u, v, w))
        noise = COPLANAR * x * y * z + bits * (x * y + y * z + z * x)
        return np.where(np.abs(value) <= noise, 0.0, np.sign(value))

    p, q = segment[:, 0], segment[:, 1]
    a, b, c = triangle[:, 0], triangle[:, 1], triangle[:, 2]
    above, below = volume(a, b, c, p), volume(a, b, c, q)
    through = np.stack([volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)])
    flat = (above == 0) & (below == 0)
    return (above * below <= 0) & ~flat & ((through >= 0).all(axis=0) | (through <= 0).all(axis=0))
