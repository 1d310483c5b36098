"""Candidates miss nothing, sums do not depend on them, and steps end before bodies meet."""

from itertools import pairwise
from weakref import WeakKeyDictionary

import ipctk
import numpy as np
import pytest

from contact_reference import DHAT, KAPPA, all_pairs, between_edges, mesh_of, surface_of, to_facets, turned
from pdvol.levels.script import Obstacle
from pdvol.measure.verify import crossings
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.candidates import Candidates
from pdvol.potentials.contact.pair_list import LIST_SLACK
from pdvol.potentials.contact.surface import ContactSurface
from pdvol.potentials.potential import LEAST_LEFT, PRESSED_GAP_SHARE, Positions
from pdvol.scene import Translation
from problems import polyline, tetrahedron
from shapes import box
from taylor import hessian_of


def heap(d, count=5, obstacle=None):
    """Small boxes beside and above each other, some within dhat and the last one far away, and a tip below them that
    may move to the right at 1 m/s.
    """
    places = np.argwhere(np.ones((2,) * d))[: count - 1] * (0.2 + 1.3 * DHAT)
    places = np.r_[places + 0.1 * DHAT * np.random.default_rng(7).uniform(-1, 1, places.shape), [[1.0] * d]]
    meshes = [box(d, 2, low=low, high=low + 0.2, jitter=0.1, seed=k) for k, low in enumerate(places)]
    if obstacle is None:
        return surface_of(*meshes)
    foot = [[-1, -2], [2, -2]] if d == 2 else [[-1, -1, -2], [2, 0, -2], [0, 2, -2]]
    tip = (polyline if d == 2 else tetrahedron)([*foot, [0.1] * (d - 1) + [-0.8 * DHAT]])
    motion = (Translation(tuple(np.eye(d)[0])),) if obstacle == "moving" else ()
    return surface_of(*meshes, obstacles=(Obstacle("tip", "mesh" if d == 3 else "polyline", *tip, *motion),))


PAIRS = WeakKeyDictionary()  # of each surface: all of them, and their codes in order


def pairs_of(candidates):
    """All pairs of points and facets, and of edges, and the codes of both, in order."""
    if candidates not in PAIRS:
        points, edges = all_pairs(candidates)
        PAIRS[candidates] = points, edges, np.sort(codes(points)), np.sort(codes(edges))
    return PAIRS[candidates]


def distances(candidates, vertices, points, edges):
    """Of pairs of points and facets (k, 2), and of edges (m, 2)."""
    primitives = candidates.primitives
    far = to_facets(vertices[points[:, 0]], vertices[primitives.facets[points[:, 1]]])
    ends = [vertices[primitives.edges[edges[:, i], k]] for i in (0, 1) for k in (0, 1)] if len(edges) else []
    return far, between_edges(*ends) if ends else np.zeros(0)


def boxes_meet(vertices, one, other, pairs):
    """Those of the pairs (k, 2) of two kinds of primitives whose bounding boxes are less than dhat apart: all that are
    so near.
    """
    for along in vertices.T:
        low, high = along[one].min(axis=1) - DHAT, along[one].max(axis=1) + DHAT
        first, second = pairs.T
        pairs = pairs[
            (along[other].max(axis=1)[second] > low[first]) & (along[other].min(axis=1)[second] < high[first])
        ]
    return pairs


def codes(pairs):
    """One number for each pair (a, b); no pair is listed twice."""
    found = pairs.astype(np.int64) @ (1, 2**32)
    assert len(np.unique(found)) == len(found), "a pair is listed twice"
    return found


def are_in(found, known):
    """Whether all of the codes stand in those that are in order."""
    places = np.searchsorted(known, found)
    return bool(np.all(places < len(known))) and np.array_equal(known[places], found)


def check_complete(candidates, vertices):
    """The lists have all pairs within dhat, and none that may not touch."""
    primitives = candidates.primitives
    points, edges, point_codes, edge_codes = pairs_of(candidates)
    points = boxes_meet(vertices, np.arange(len(vertices))[:, None], primitives.facets, points)
    edges = boxes_meet(vertices, primitives.edges, primitives.edges, edges)
    far, apart = distances(candidates, vertices, points, edges)
    listed = codes(np.concatenate([pairs.pairs.listed[0] for pairs in candidates.lists]))
    crossing = codes(np.sort(np.concatenate([pairs.pairs.listed[1] for pairs in candidates.lists]), axis=1))
    assert np.isin(codes(points[far < DHAT]), listed).all() and are_in(listed, point_codes)
    assert np.isin(codes(edges[apart < DHAT]), crossing).all() and are_in(crossing, edge_codes)
    first = np.concatenate([pairs.pairs.listed[0] for pairs in candidates.lists[:1]])[:, 0]
    assert np.count_nonzero(np.diff(first)) + 1 == len(set(first)) or not len(first), "a vertex's pairs stand together"
    return int((far < DHAT).sum() + (apart < DHAT).sum())


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("obstacle", [None, "moving"])
@pytest.mark.parametrize("size", [1e-4, 0.05, 0.5])
def test_lists_are_complete_on_random_walks(d, obstacle, size):
    """Bodies move by any length, some of them all together, turn by any angle, are bent, and are flattened until they
    touch themselves: at the ends of straight moves, and anywhere on the way, after any history.
    """
    space, candidates = heap(d, obstacle=obstacle)
    rng, time, near = np.random.default_rng(5), 0.0, 0
    x = Positions(space, space.from_input(space.mesh.points))
    bodies = space.mesh.point_bodies[space.owned_points]
    count = bodies.max() + 1
    for k, angle in enumerate((0.0, 0.02, 0.0, 0.3, 1.5, 0.0, 3.1)):
        common = rng.standard_normal(d) * (10.0 if k % 3 == 0 and not obstacle else 0.3)
        own = rng.standard_normal((count, d))[bodies] if k % 2 else 0.0
        to = turned(x.owned, bodies, angle * rng.uniform(-1, 1, count))
        to = to + size * (common + own + 0.3 * rng.uniform(-1, 1, to.shape))
        if k == 4:  # flat: all vertices of a body are near facets of its own
            to[:, 0] = 0.02 * to[:, 0]
        direction, until = to - x.owned, time + size
        start, end = candidates.surface.vertices(x), candidates.surface.vertices(x.moved(1.0, direction), at=until)
        for pairs in candidates.lists:
            pairs.along(start, end)
        for share in (0.0, 0.37, 0.8, 1.0):
            near += check_complete(candidates, start + share * (end - start))
        for share in (1.0, 0.3):  # and what is kept serves where it is said to
            there = start + share * (end - start)
            candidates.contacts(there, KAPPA)
            near += check_complete(candidates, there)
        x = x.moved(0.6, direction)
        time = time + 0.6 * size
        candidates.surface.move_obstacles(time)
        candidates.contacts(candidates.surface.vertices(x), KAPPA)
        near += check_complete(candidates, candidates.surface.vertices(x))
    assert near > 0


@pytest.mark.parametrize("d", [2, 3])
def test_one_search_serves_small_and_common_moves(d):
    """Within the slack, and however far all bodies move together. A move of one body past that is searched anew between
    bodies. Within them no rigid motion is but by half a turn; changes of shape and NaN are.
    """
    space, candidates = heap(d)
    x = Positions(space, space.from_input(space.mesh.points))
    candidates.contacts(candidates.surface.vertices(x), KAPPA)
    within, between = candidates.lists
    slack = LIST_SLACK * candidates.primitives.edge_length
    rng = np.random.default_rng(1)
    for k in range(5):
        noise = 0.9 * slack / np.sqrt(d) * rng.uniform(-1, 1, x.owned.shape) * 0.5
        moved = Positions(space, x.owned + 3.0 * k + noise)
        candidates.contacts(candidates.surface.vertices(moved), KAPPA)
        check_complete(candidates, candidates.surface.vertices(moved))
    assert within.searches == between.searches == 1
    bodies = space.mesh.point_bodies[space.owned_points]
    one = np.where(bodies[:, None] == 0, 10.0, 0.0)
    candidates.contacts(candidates.surface.vertices(Positions(space, x.owned + one)), KAPPA)
    assert within.searches == 1 and between.searches == 2
    start, objects = candidates.surface.vertices(x), candidates.surface.objects
    places = [start + np.linspace(1.0, 30.0, within.primitives.bodies)[objects][:, None]]
    places += [turned(places[0], objects, np.full(within.primitives.bodies, angle)) for angle in (0.4, 0.8, 2.5, 3.5)]
    for one, other in pairwise(places):
        within.along(one, other)
    assert within.searches == 1
    lost = np.where(objects[:, None] == 0, np.nan, start)
    for end in (lost, 0.3 * start, turned(start, objects, np.full(within.primitives.bodies, 3.1))):
        before = within.searches
        within.along(start, end)
        assert within.searches > before


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("obstacle", [None, "moving"])
def test_sums_do_not_depend_on_lists(d, obstacle):
    """A surface with a history gives the same numbers as a new one, to the last bit: energy, forces, Hessian, steps."""
    space, used = heap(d, 6, obstacle)
    barrier = ContactBarrier(used, KAPPA)
    rng, touched, time = np.random.default_rng(2), 0, 0.0
    x = Positions(space, space.from_input(space.mesh.points))
    for _ in range(12):
        direction = 10.0 ** rng.uniform(-3, -0.5) * rng.uniform(-1, 1, x.owned.shape) + 0.1 * rng.uniform(-1, 1, d)
        step = barrier.max_step(x, direction, until=time + 0.01)
        barrier.value(x.moved(step, direction))
        x, time = x.moved(0.7 * step, direction), time + 0.007 * step
        barrier.move_obstacles(time)
        fresh = ContactBarrier(Candidates(ContactSurface(space, used.surface.obstacles), DHAT), KAPPA)
        fresh.move_obstacles(time)
        anew = Positions(space, x.owned.copy())
        assert barrier.value(x) == fresh.value(anew)
        np.testing.assert_array_equal(barrier.gradient(x), fresh.gradient(anew))
        for mode in ("none", "clamp"):
            ours, theirs = (hessian_of(term, space, x.owned, mode) for term in (barrier, fresh))
            np.testing.assert_array_equal(ours.toarray(), theirs.toarray())
        assert barrier.max_step(x, direction, until=time + 0.01) == fresh.max_step(anew, direction, until=time + 0.01)
        touched += len(barrier.contacts(x)) > 0
    assert touched > 3


# ---- collision detection


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("obstacle", [None, "still", "moving"])
@pytest.mark.parametrize("size", [0.02, 0.3, 3.0])
def test_nothing_meets_during_a_step(d, obstacle, size):
    """By the independent check, at the end of each step and on the way; the steps are nearly as long as they may be."""
    space, candidates = heap(d, 6, obstacle)
    rng, stopped, time = np.random.default_rng(11), 0, 0.0
    x = Positions(space, space.from_input(space.mesh.points))
    mesh = mesh_of(candidates)
    exact = ipctk.AdditiveCCD(max_iterations=100_000, conservative_rescaling=0.999)
    bodies = space.mesh.point_bodies[space.owned_points]
    assert met(candidates, candidates.surface.vertices(x)) == []
    for _ in range(8):
        own = rng.standard_normal((bodies.max() + 1, d))[bodies]
        direction = size * (own + 0.2 * rng.uniform(-1, 1, x.owned.shape))
        start = candidates.surface.vertices(x)
        end = candidates.surface.vertices(x.moved(1.0, direction), at=time + size)
        step = candidates.max_step(start, end)
        free = ipctk.compute_collision_free_stepsize(
            mesh=mesh, vertices_t0=start, vertices_t1=end, broad_phase=ipctk.BruteForce(), narrow_phase_ccd=exact
        )
        assert 0.0 < step <= max(free, 1.0 if free == 1.0 else free) and step > 0.7 * min(free, 1.0) or free < 1e-3
        stopped += step < 1.0
        for share in (1.0, 0.6):
            assert met(candidates, start + share * step * (end - start)) == []
        x, time = x.moved(step, direction), time + step * size
        candidates.surface.move_obstacles(time)
    assert stopped or size < 0.1


def met(candidates, vertices):
    own = len(candidates.surface.surface)
    facets = candidates.primitives.facets
    solids = facets[facets.min(axis=1) >= own]
    others = [(vertices[own:], solids - own)] if len(solids) else []
    return crossings(vertices[:own], facets[facets.max(axis=1) < own], others)


@pytest.mark.parametrize("share", [LEAST_LEFT, PRESSED_GAP_SHARE, 0.5])
def test_every_pair_keeps_its_share(share):
    """Of its own gap, or of dhat where that is less, by distances of all pairs; the nearest keeps little more. A
    move of all bodies together is never cut.
    """
    space, candidates = heap(3, 6)
    start = candidates.surface.vertices(Positions(space, space.from_input(space.mesh.points)))
    assert candidates.max_step(start, start + [3.0, -7.0, 5.0]) == candidates.max_step(start, start) == 1.0
    pairs = pairs_of(candidates)[:2]
    before = distances(candidates, start, *pairs)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        end = start + rng.standard_normal((candidates.surface.objects.max() + 1, 3))[candidates.surface.objects]
        step = candidates.max_step(start, end, share)
        after = distances(candidates, start + step * (end - start), *pairs)
        kept = [other / (share * np.minimum(one, DHAT)) for one, other in zip(before, after, strict=True)]
        assert min(each.min() for each in kept) >= 1.0 - 1e-9
        assert step == 1.0 or min(each.min() for each in kept) < 1.0 + 0.02 / share


# ---- bounds


def bounds_of(pairs, vertices):
    """What the list's pairs of points and of edges are apart at least (k,) at positions (n, d): their bounds, less the
    share of the way times their rates, and twice the largest distance from the way.
    """
    counts, (begin, end) = tuple(map(len, pairs.pairs.listed)), pairs.pairs.way
    size = np.vdot(end - begin, end - begin)
    share = np.clip(np.vdot(vertices - begin, end - begin) / size, 0.0, 1.0) if size else 0.0
    off = np.linalg.norm(vertices - begin - share * (end - begin), axis=1).max()
    return [
        bounds[:count] - share * rates[:count] - 2.0 * off
        for bounds, rates, count in zip(pairs.pairs._bounds, pairs.pairs._rates, counts, strict=True)
    ]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("obstacle", [None, "moving"])
def test_bounds_are_no_larger_than_distances(d, obstacle):
    """On the way that collision detection has looked at, beside it, and far from it; after small steps they still show
    that most of the pairs beyond dhat are no contacts.
    """
    space, candidates = heap(d, obstacle=obstacle)
    rng, beyond, shown, time = np.random.default_rng(3), 0, 0, 0.0
    x = Positions(space, space.from_input(space.mesh.points))
    for k in range(12):
        size = DHAT * 10.0 ** rng.uniform(-4, 0.5)
        direction = size * (rng.standard_normal(d) + 0.1 * rng.uniform(-1, 1, x.owned.shape))
        until = time + size
        start, end = candidates.surface.vertices(x), candidates.surface.vertices(x.moved(1.0, direction), at=until)
        step = candidates.max_step(start, end)
        beside = 1e-3 * DHAT * rng.uniform(-1, 1, start.shape)
        places = [start + share * (end - start) + off for share in (0.0, 0.4, step) for off in (0.0, beside)]
        for place in [*places, start + 3.0 * rng.uniform(-1, 1, start.shape)]:
            for pairs in candidates.lists:
                points, edges = pairs.pairs.listed
                corners = candidates.primitives.facets[points[:, 1]]
                ends = candidates.primitives.edges[edges]
                found = [to_facets(place[points[:, 0]], place[corners])]
                found += [between_edges(*(place[ends[:, i, j]] for i in (0, 1) for j in (0, 1)))] if d == 3 else []
                for bounds, apart in zip(bounds_of(pairs, place), found, strict=False):
                    assert np.all(bounds <= apart + 1e-12)
                    if place is places[4] and k > 0:
                        beyond += np.sum(apart > 1.1 * DHAT)
                        shown += np.sum((apart > 1.1 * DHAT) & (bounds > DHAT))
        x, time = x.moved(step, direction), time + step * size
        candidates.surface.move_obstacles(time)
    assert beyond > 100 and shown > 0.6 * beyond
