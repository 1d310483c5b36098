"""Contact energy, candidates and distances by brute force and in numpy alone; scenes of bodies that touch; slides."""

from weakref import WeakKeyDictionary

import ipctk
import numpy as np
from mpi4py import MPI
from scipy.spatial.transform import Rotation

import barrier_law
from pdvol.geometry.level_mesh import facet_sizes
from pdvol.levels.script import Obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.candidates import Candidates
from pdvol.potentials.contact.surface import ContactSurface
from pdvol.potentials.potential import Positions
from problems import polyline, tetrahedron
from shapes import box, level, together

DHAT, KAPPA = 0.03, 0.7
PARALLEL = 1e-3  # sin^2 below which crossing edges fade, docs/contact.md


# ---- scenes


def surface_of(*meshes, obstacles=(), dhat=DHAT):
    """The space and the surface of bodies in one level."""
    space = LevelSpace(together(*meshes), MPI.COMM_SELF)
    return space, Candidates(ContactSurface(space, obstacles), dhat)


def two_boxes(d, obstacle=False, **options):
    """A finer box 0.6 dhat above a coarser one, both jittered; with an obstacle's tip below the lower one."""
    low = np.r_[np.full(d - 1, 0.13), 1.0 + 0.6 * DHAT]
    meshes = box(d, 3, jitter=0.02, seed=1), box(d, 4, low=low, high=low + 0.7, jitter=0.02, seed=2)
    foot = [[-1, -2], [2, -2]] if d == 2 else [[-1, -1, -2], [2, 0, -2], [0, 2, -2]]
    tip = (polyline if d == 2 else tetrahedron)([*foot, [0.5] * (d - 1) + [-0.5 * DHAT]])
    obstacles = (Obstacle("tip", "mesh" if d == 3 else "polyline", *tip),) if obstacle else ()
    return surface_of(*meshes, obstacles=obstacles, **options)


def crossing_tetrahedra(angle, size=1.0, seed=None):
    """Two tetrahedra, an edge of one 0.6 dhat above an edge of the other, at an angle, from its end to its start at
    rest. Positions (8, 3) are crushed to `size` and turned at random by a seed.
    """
    below = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, -0.6, -0.8], [0.5, 0.6, -0.8]])
    above = np.array([[1.4, 0, 0], [0.4, 0, 0], [0.9, -0.6, 0.8], [0.9, 0.6, 0.8]])
    space, candidates = surface_of(*(level(points, [[0, 1, 2, 3]]) for points in (below, above + [0, 0, 0.6 * DHAT])))
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    points = space.mesh.points.copy()
    points[:4] = size * (points[:4] - [0.5, 0, 0])
    points[4:] = size * (points[4:] - [0.9, 0, 0.6 * DHAT]) @ turn.T + [0, 0, 0.6 * DHAT]
    frame = np.eye(3) if seed is None else np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    return space, candidates, points @ frame.T, frame


def random_tetrahedra(seed, count=2, size=1.0):
    """Tetrahedra of any shape, about dhat apart: mixtures of all kinds of contact, some with fades."""
    rng = np.random.default_rng(seed)
    return surface_of(*[level(rng.uniform(-1, 1, (4, 3)) * size, [[0, 1, 2, 3]]) for _ in range(count)])


def mesh_of(candidates):
    """ipctk's mesh of the same vertices, edges and faces at rest; obstacles do not meet each other."""
    surface, primitives = candidates.surface, candidates.primitives
    at_rest = np.concatenate([surface.space.mesh.points[surface.surface], surface._obstacles_at(0.0)])
    mesh = ipctk.CollisionMesh(rest_positions=at_rest, edges=primitives.lines, faces=primitives.triangles)
    mesh.can_collide = ipctk.make_static_obstacle_filter(len(surface.surface))
    return mesh


# ---- distances


def to_segment(p, a, b):
    """Closest point of the segment ab to p (k, d), by clipping: the gap vectors (k, d) from it to p."""
    along = b - a
    t = np.clip(np.einsum("kd,kd->k", p - a, along) / np.einsum("kd,kd->k", along, along), 0.0, 1.0)
    return p - a - t[:, None] * along


def to_facets(p, corners):
    """Distances (k,) of points (k, d) and facets (k, d, d): the least of those to the sides, or to the plane where the
    foot has positive coordinates.
    """
    d = p.shape[1]
    if d == 2:
        return np.linalg.norm(to_segment(p, corners[:, 0], corners[:, 1]), axis=1)
    sides = [np.linalg.norm(to_segment(p, corners[:, i], corners[:, (i + 1) % 3]), axis=1) for i in range(3)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inside = np.all(
        [
            np.einsum("kd,kd->k", np.cross(corners[:, (i + 1) % 3] - corners[:, i], p - corners[:, i]), normals) >= 0.0
            for i in range(3)
        ],
        axis=0,
    )
    heights = np.abs(np.einsum("kd,kd->k", p - corners[:, 0], normals)) / np.linalg.norm(normals, axis=1)
    return np.where(inside, heights, np.min(sides, axis=0))


def between_edges(a, b, c, d):
    """Distances (k,) of segments: the least of the ends' distances, or of the lines' where both feet are inside."""
    ends = [(a, c, d), (b, c, d), (c, a, b), (d, a, b)]
    distances = np.min([np.linalg.norm(to_segment(*end), axis=1) for end in ends], axis=0)
    lines, inside, _ = crossing(a, b, c, d)
    return np.where(inside, np.minimum(lines, distances), distances)


def crossing(a, b, c, d):
    """Of lines through segments: their distance, whether the closest points are inside both segments, and sin^2 of
    their angle, (k,) each. By the normal of both.
    """
    u, v, w = b - a, d - c, c - a
    normal = np.cross(u, v)
    area = np.maximum(np.einsum("kd,kd->k", normal, normal), 1e-300)
    s = np.einsum("kd,kd->k", np.cross(w, v), normal) / area
    t = np.einsum("kd,kd->k", np.cross(w, u), normal) / area
    sine = area / np.einsum("kd,kd->k", u, u) / np.einsum("kd,kd->k", v, v)
    distance = np.abs(np.einsum("kd,kd->k", w, normal)) / np.sqrt(area)
    return distance, (s > 0) & (s < 1) & (t > 0) & (t < 1) & (sine > 1e-20), sine


# ---- by brute force


def all_pairs(candidates):
    """Pairs of vertices and facets (k, 2), and of edges (m, 2), that may touch: of one body, of two, or of a body and
    an obstacle, without a vertex in common.
    """
    primitives, owner = candidates.primitives, candidates.surface.objects
    bodies = int(candidates.surface.space.mesh.point_bodies.max()) + 1

    def may_touch(one, other):
        return np.minimum(owner[one[..., 0]], owner[other[..., 0]]) < bodies

    def disjoint(one, other):
        return ~(one[..., :, None] == other[..., None, :]).any(axis=(-1, -2))

    points, facets, edges = np.arange(len(owner))[:, None, None], primitives.facets[None], primitives.edges
    mask = may_touch(points, facets) & disjoint(np.broadcast_to(points, (len(owner), facets.shape[1], 1)), facets)
    one, other = np.triu_indices(len(edges), 1)
    kept = may_touch(edges[one], edges[other]) & disjoint(edges[one], edges[other])
    return np.argwhere(mask), np.column_stack([one, other])[kept]


def fade(t):
    return np.where(t < 1.0, (2.0 - t) * t, 1.0)


CONNECTED = WeakKeyDictionary()  # of each surface: its connections, which do not change


def connections(candidates):
    """Of each vertex that may touch: its number, area [m^(d-1)], and the facets (k, d), edges (m, 2) and vertices (n,)
    that it faces, the latter two with their weights. Then pairs of edges (k, 2, 2), and their areas.
    """
    surface, primitives, d = candidates.surface, candidates.primitives, candidates.surface.space.dim
    facets, edges = primitives.facets.astype(int), primitives.edges.astype(int)
    at_rest = np.concatenate([surface.space.mesh.points[surface.surface], surface._obstacles_at(0.0)])
    sizes = facet_sizes(at_rest, facets) / d
    area = np.zeros(len(at_rest))
    for facet, size in zip(facets, sizes, strict=True):
        area[facet] += 0.5 * size
    sides = {tuple(edge): [] for edge in edges}
    for f, facet in enumerate(facets) if d == 3 else ():
        for i in range(3):
            sides[tuple(sorted((facet[i], facet[(i + 1) % 3])))].append(f)
    edge_share = {edge: 1 - len(of) for edge, of in sides.items()}
    vertex_share = np.array(
        [
            1 - int((facets == v).any(axis=1).sum()) - sum(share for edge, share in edge_share.items() if v in edge)
            for v in range(len(at_rest))
        ]
    )
    pairs, crossed = all_pairs(candidates)
    points = []
    for p in np.unique(pairs[:, 0]):
        facing = facets[pairs[pairs[:, 0] == p, 1]]
        met = sorted({tuple(sorted((f[i], f[(i + 1) % 3]))) for f in facing for i in range(3)}) if d == 3 else []
        ends, corners = np.array(met, dtype=int).reshape(-1, 2), np.unique(facing)
        weights = np.array([edge_share[edge] for edge in met], dtype=float)
        points.append((p, area[p], facing, (ends, weights), (corners, vertex_share[corners])))
    beside = np.array([0.5 * sum(sizes[f] for f in sides[tuple(edge)]) for edge in edges])
    return points, edges[crossed].reshape(-1, 2, 2), beside[crossed].reshape(-1, 2).min(axis=1)


def brute_force_energy(candidates, vertices):
    """(points part, edges part) of the contact energy [J], straight from the definition in docs/contact.md."""
    if candidates not in CONNECTED:
        CONNECTED[candidates] = connections(candidates)
    points, crossed, least = CONNECTED[candidates]
    energy = lambda r: np.where(
        r < DHAT, barrier_law.energy(np.minimum(np.maximum(r, 1e-300) / DHAT, 1.0) ** 2, DHAT, KAPPA), 0.0
    )
    total = 0.0
    for p, area, facing, (ends, edge_shares), (corners, vertex_shares) in points:
        repeated = lambda count, p=p: np.broadcast_to(vertices[p], (count, vertices.shape[1]))
        total += area * energy(to_facets(repeated(len(facing)), vertices[facing])).sum()
        gaps = to_segment(repeated(len(ends)), vertices[ends[:, 0]], vertices[ends[:, 1]])
        total += area * np.dot(edge_shares, energy(np.linalg.norm(gaps, axis=1)))
        total += area * np.dot(vertex_shares, energy(np.linalg.norm(vertices[p] - vertices[corners], axis=1)))
    if not len(crossed):
        return total, 0.0
    ends = [vertices[crossed[:, i, k]] for i in (0, 1) for k in (0, 1)]
    inside = crossing(*ends)[1]
    a, b, c, e = (end[inside] for end in ends)
    r, _, sine = crossing(a, b, c, e)
    share = least[inside] * fade(sine / PARALLEL)
    for end in ((a, c, e), (b, c, e), (c, a, b), (e, a, b)):
        nearest = np.linalg.norm(to_segment(*end), axis=1)
        share = share * fade(np.maximum((nearest / np.maximum(r, 1e-300)) ** 2 - 1.0, 0.0))
    return total, float(share @ energy(r))


# ---- slides


def check_slide(space, candidates, start, end, tolerance=1e-6, parts=200, sections=40):
    """Along a straight way of the level's points, in the input's order, the energy changes by the integral of its
    slope, and the slope does not jump: intervals are halved where that is not seen yet. Returns the energies.

    A jump of the energy or of the slope is left however short intervals become.
    """
    barrier = ContactBarrier(candidates, KAPPA)
    places = space.from_input(np.asarray(start)), space.from_input(np.asarray(end))
    move = places[1] - places[0]

    def at(share):
        x = Positions(space, places[0] + share * move)
        return barrier.value(x), float(np.vdot(barrier.gradient(x), move))

    shares = np.linspace(0.0, 1.0, parts + 1)
    found = [at(share) for share in shares]
    largest = max(abs(energy) for energy, _ in found)
    steepest = max(largest, *(abs(slope) for _, slope in found))  # the way is about as long as contact reaches
    assert largest > 0.0, "nothing touches"
    pending = list(zip(shares[:-1], shares[1:], found[:-1], found[1:], strict=True))
    unexplained = 0.0
    while pending:
        a, b, one, other = pending.pop()
        middle = at(0.5 * (a + b))
        promised = (b - a) * (one[1] + 4.0 * middle[1] + other[1]) / 6.0
        off = abs(other[0] - one[0] - promised)
        smooth = abs(other[1] - one[1]) <= 0.02 * steepest
        if off <= 1e-3 * tolerance * largest and smooth:
            unexplained += off
            assert unexplained <= tolerance * largest
            continue
        if b - a < 2.0**-sections:
            assert off <= 1e-3 * tolerance * largest, f"the energy jumps by {off / largest:.1e} at {a:.12f}"
            assert smooth, f"the slope jumps by {abs(other[1] - one[1]) / steepest:.1e} of the steepest at {a:.12f}"
        m = 0.5 * (a + b)
        pending += [(a, m, one, middle), (m, b, middle, other)]
    return np.array([energy for energy, _ in found])


def turned(points, bodies, angles):
    """Each body turned about its centre by its angle [rad], about an arbitrary axis in 3D."""
    d = points.shape[1]
    axes = np.random.default_rng(3).standard_normal((len(angles), 3))
    axes = np.array([[0.0, 0.0, 1.0]] * len(angles)) if d == 2 else axes / np.linalg.norm(axes, axis=1)[:, None]
    out = points.copy()
    for body, turn in enumerate(Rotation.from_rotvec(axes * angles[:, None]).as_matrix()[:, :d, :d]):
        own = bodies == body
        centre = points[own].mean(axis=0)
        out[own] = centre + (points[own] - centre) @ turn.T
    return out
