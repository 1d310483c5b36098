"""Contact pairs: kept candidates miss nothing, and stencils are the pairs' own geometry."""

import ipctk
import numpy as np
import pytest
from mpi4py import MPI

from pdvol.levels.space import LevelSpace
from pdvol.potentials.contact import barrier_law, candidates
from pdvol.potentials.contact.barrier import SurfaceBarrier
from pdvol.potentials.contact.collision_surface import CollisionSurface, Obstacle
from pdvol.potentials.contact.friction import SurfaceFriction
from pdvol.potentials.potential import MIN_GAP_SHARE, SCRIPTED_GAP_SHARE, Positions
from problems import polyline, tetrahedron
from shapes import box, level, together
from taylor import hessian_of

COMM = MPI.COMM_SELF
DHAT, KAPPA = 0.03, 0.7


def two_boxes(d, obstacle=False):
    """A finer box 0.6 dhat above a coarser one, both jittered; with an obstacle's tip below the lower one."""
    low = np.r_[np.full(d - 1, 0.13), 1.0 + 0.6 * DHAT]
    space = LevelSpace(
        together(box(d, 3, jitter=0.02, seed=1), box(d, 4, low=low, high=low + 0.7, jitter=0.02, seed=2)), COMM
    )
    foot = [[-1, -2], [2, -2]] if d == 2 else [[-1, -1, -2], [2, 0, -2], [0, 2, -2]]
    tip = (polyline if d == 2 else tetrahedron)([*foot, [0.5] * (d - 1) + [-0.5 * DHAT]])
    obstacles = (Obstacle("tip", "mesh" if space.dim == 3 else "polyline", *tip),) if obstacle else ()
    return space, CollisionSurface(space, obstacles, DHAT)


def edges_side_by_side(angle, foot=False):
    """Two tetrahedra, an edge of one 0.6 dhat above an edge of the other and almost along it, from its end to its start
    in the input. The lower one may stand on a third, edge across edge.
    """
    below = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, -0.6, -0.8], [0.5, 0.6, -0.8]])
    above = np.array([[1.4, 0, 0], [0.4, 0, 0], [0.9, -0.6, 0.8], [0.9, 0.6, 0.8]])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    above = (above - [0.9, 0, 0]) @ turn.T + [0.9, 0, 0.6 * DHAT]
    bodies = [below, above, *([below - [0, 0, 0.8 + 0.6 * DHAT]] if foot else [])]
    space = LevelSpace(together(*(level(points, [[0, 1, 2, 3]]) for points in bodies)), COMM)
    return space, CollisionSurface(space, (), DHAT)


@pytest.mark.parametrize("angle", [0.01, 0.02, 0.025])
@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.2, 0.06, 0.0), (0.4, -0.03, 0.01), (0.0, 0.08, 0.005)])
def test_the_energy_of_edges_side_by_side_does_not_jump(angle, way):
    """Pairs appear and disappear along the path. The energy still changes by the integral of its gradient."""
    space, surface = edges_side_by_side(angle)
    energies, promised = slide(space, surface, space.mesh.points, np.array(way))
    np.testing.assert_allclose(np.diff(energies), promised, atol=1e-3 * energies.max())


@pytest.mark.parametrize("foot", [False, True])
@pytest.mark.parametrize("begun", [(0.0, 0.0, 0.5), (0.0, 0.0, 2.0), (0.0, 1.0, 0.0)])
def test_the_energy_of_edges_that_meet_later_in_a_step_does_not_jump(begun, foot):
    """Edges that meet later in a step are also turned to the same direction. This holds where other edges have met
    before, too.
    """
    space, surface = edges_side_by_side(0.02, foot)
    energies, promised = slide(space, surface, space.mesh.points, np.array([0.4, -0.03, 0.01]), begun)
    np.testing.assert_allclose(np.diff(energies), promised, atol=1e-3 * energies.max())


def slide(space, surface, points, way, begun=(0.0, 0.0, 0.0)):
    """The second body goes from -0.7 to 0.7 of a way: energies, and what their gradients promise that they change by.
    The step begins where it is `begun` away from the middle.
    """
    barrier = SurfaceBarrier(surface, DHAT, KAPPA)
    places = [
        Positions(space, space.from_input(points + np.where(space.mesh.point_bodies[:, None] == 1, way, 0.0)))
        for way in (begun, np.zeros(3))
    ]
    barrier.begin_step(places[0], 0.0, 0.01)
    first = barrier.value(places[0])
    move = space.from_input(np.where(space.mesh.point_bodies[:, None] == 1, way, 0.0))
    places = [places[1].moved(share, move) for share in np.linspace(-0.7, 0.7, 2001)]
    energies = np.array([barrier.value(y) for y in places])
    slopes = np.array([np.vdot(barrier.gradient(y), move) for y in places])
    assert np.ptp(energies) > 0.1 * energies.max() > 0.0
    assert not any(begun) or first <= energies.min(), "all met at once"
    return energies, 0.5 * (slopes[1:] + slopes[:-1]) * 1.4 / 2000


def crushed_edges(size, angle, seed):
    """The two tetrahedra, crushed to `size`, their edges crossing at an angle, any way round; and the same at rest, as
    large as before.
    """
    space, surface = edges_side_by_side(0.0)
    frame = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    below, above = space.mesh.points[:4] - [0.5, 0, 0], (space.mesh.points[4:] - [0.9, 0, 0.6 * DHAT]) @ turn.T
    return (
        space,
        surface,
        np.concatenate([size * below, size * above + [0, 0, 0.6 * DHAT]]) @ frame.T,
        size * np.array([1.0, 0.3, 0.0]) @ frame.T,
    )


@pytest.mark.parametrize(
    "size, angle, seed",
    [(1 / 6, 0.5, 2), (1 / 6, 0.5, 3), (1 / 6, 0.2, 0), (1 / 4, 0.5, 3), (1 / 4, 0.5, 7), (1 / 7, 1.0, 0)],
)
def test_the_energy_of_crushed_edges_does_not_jump(size, angle, seed):
    """Their lengths at rest say when edges count as nearly parallel: these do at 30 degrees, where they do not all run
    alike.
    """
    space, surface, points, way = crushed_edges(size, angle, seed)
    energies, promised = slide(space, surface, points, way)
    np.testing.assert_allclose(np.diff(energies), promised, atol=1e-4 * energies.max())


def test_crushed_edges_push_for_their_area_at_rest():
    """Where they cross at right angles, the energy is that of edges that are not crushed."""
    crossing = [slide(*crushed_edges(size, 0.5 * np.pi, 0))[0][1000] for size in (1.0, 0.6, 0.3, 0.1)]
    np.testing.assert_allclose(crossing, crossing[0], rtol=1e-10)


def test_pairs_of_edges_that_are_far_apart_are_dropped():
    """Edges of flat faces, whose boxes meet: the pairs that are left are exactly those nearer than some distance, which
    is little more than dhat.
    """
    space, surface = two_boxes(3)
    vertices = surface.vertices(Positions(space, space.from_input(space.mesh.points)))
    surface.candidates.begin(vertices, vertices)
    ends = lambda c: [vertices[i] for edge in (c.edge0_id, c.edge1_id) for i in surface.mesh.edges[edge]]
    distance = lambda c: np.sqrt(ipctk.edge_edge_distance(*ends(c)))
    left = list(surface.candidates.pairs.ee_candidates)
    near = max(map(distance, left))
    assert DHAT < near < 2.0 * DHAT
    boxes = ipctk.Candidates()
    boxes.build(mesh=surface.mesh, vertices=vertices, inflation_radius=0.5 * near, broad_phase=ipctk.LBVH())
    pairs = lambda candidates: sorted((c.edge0_id, c.edge1_id) for c in candidates)
    assert pairs(left) == pairs(c for c in boxes.ee_candidates if distance(c) <= near)
    assert 0 < 2 * len(left) < len(boxes.ee_candidates)


@pytest.mark.parametrize("expected_move", [0.0, 0.1, 0.5, 2.0])
def test_candidates_are_kept_within_the_slack(expected_move):
    """A search leaves room for the move that is expected, and for a little more; longer ones than the largest slack are
    not searched for in advance.
    """
    space, surface = two_boxes(3, obstacle=True)
    rest = surface.vertices(Positions(space, space.from_input(space.mesh.points)))
    edges = rest[surface.mesh.edges]
    largest = candidates.MAX_SLACK * np.median(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1))
    slack = largest * max(candidates.MIN_SLACK, candidates.SLACK_PER_MOVE * expected_move)
    moved = lambda length: np.asfortranarray(rest + np.r_[length, 0.0, 0.0])
    surface.begin(rest)
    found = surface.candidates
    found.begin(rest, moved(largest * expected_move))
    assert found.searches == (slack <= largest)
    if slack <= largest:
        for length, searches in ((0.999 * slack, 1), (1.001 * slack, 2)):
            found.at(moved(length))
            assert found.searches == searches


def test_positions_on_the_line_of_a_move_need_no_new_search():
    """Positions on the line of the move need no new search, and round-off off the line is accepted. Positions beyond
    the end of the move or beside the line need a new search.
    """
    space, surface = two_boxes(3, obstacle=True)
    start = surface.vertices(Positions(space, space.from_input(space.mesh.points)))
    move = np.random.default_rng(1).uniform(-1.0, 1.0, start.shape)
    found, size = surface.candidates, np.abs(start).max()
    for where, searches in (
        (start + 0.3 * move, 1),
        (start + 0.3 * move + 0.1 * candidates.STRAIGHT_TOLERANCE * size, 1),
        (start + 2.0 * move, 2),
        (start + 0.3 * move + 1e3 * candidates.STRAIGHT_TOLERANCE * size, 2),
    ):
        found.forget()
        found.searches = 0
        found.along(start, np.asfortranarray(start + move))
        found.at(np.asfortranarray(where))
        assert found.searches == searches


@pytest.mark.parametrize("angle", [1e-3, 1e-6, 1e-9])
def test_pairs_at_the_searched_distance_are_kept(monkeypatch, angle):
    """Distances of nearly parallel edges are found too large by up to 1e-6 of their length, which the margin covers."""
    monkeypatch.setattr(candidates, "MAX_SLACK", 1e-2)
    space, surface = edges_side_by_side(angle)
    found = surface.candidates
    vertices = surface.vertices(Positions(space, space.from_input(space.mesh.points)))
    slack = candidates.MIN_SLACK * found.max_slack
    found.reach = 0.6 * DHAT - 2.0 * slack
    pairs = [{c.edge0_id, c.edge1_id} for c in found.at(vertices).ee_candidates]
    lengths = vertices[surface.mesh.edges][:, :, 2]
    assert {int(np.flatnonzero(np.all(lengths == z, axis=1))[0]) for z in (0.0, 0.6 * DHAT)} in pairs


def searched_anew(surface, vertices):
    active = ipctk.NormalCollisions()
    active.use_area_weighting = True
    active.collision_set_type = ipctk.NormalCollisions.CollisionSetType.IMPROVED_MAX_APPROX
    active.build(mesh=surface.mesh, vertices=vertices, dhat=DHAT, broad_phase=ipctk.BruteForce())
    return active


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("obstacle", [False, True])
@pytest.mark.parametrize("size", [1e-4, 3e-3, 0.05, 0.5])
def test_candidates_are_those_of_a_search_anew(d, obstacle, size):
    """Random walks by Newton-like moves: caps and active pairs are those of brute force, at the ends and on the way."""
    space, surface = two_boxes(d, obstacle)
    barrier = SurfaceBarrier(surface, DHAT, KAPPA)
    theirs = ipctk.BarrierPotential(dhat=DHAT, stiffness=KAPPA, use_physical_barrier=True)
    rng = np.random.default_rng(5)
    x = Positions(space, space.from_input(space.mesh.points))
    narrow = ipctk.AdditiveCCD(max_iterations=10_000, conservative_rescaling=0.9)
    stopped = 0
    for k in range(12):
        common = rng.standard_normal(d) * (10.0 if k % 3 == 0 and not obstacle else 0.3)
        direction = size * (common + rng.uniform(-1, 1, x.owned.shape))
        start, end = surface.vertices(x), surface.vertices(x.moved(1.0, direction))
        step = surface.max_step(start, end)
        expected = ipctk.compute_collision_free_stepsize(
            mesh=surface.mesh,
            vertices_t0=start,
            vertices_t1=end,
            min_distance=0.0,
            broad_phase=ipctk.BruteForce(),
            narrow_phase_ccd=narrow,
        )
        np.testing.assert_allclose(step, expected, rtol=1e-12)
        stopped += step < 1.0
        for share in (1.0, 0.5, 0.1):
            trial = x.moved(share * step, direction)
            anew = searched_anew(surface, surface.vertices(trial))
            np.testing.assert_allclose(
                barrier.value(trial), theirs(anew, surface.mesh, surface.vertices(trial)), rtol=1e-10, atol=1e-300
            )
        x = x.moved(0.5 * step, direction)
    assert stopped or size < 0.05, "nothing came near"
    assert surface.candidates.searches <= (30 if size > 1e-3 else 2)


@pytest.mark.parametrize("d", [2, 3])
def test_stencils_know_the_distances(d):
    space, surface = two_boxes(d, obstacle=True)
    barrier = SurfaceBarrier(surface, DHAT, KAPPA)
    active, vertices = barrier.collisions(Positions(space, space.from_input(space.mesh.points)))
    stencils = surface.stencils(active, vertices)
    ends = [c for c in active.ee_collisions if c.dtype != ipctk.EdgeEdgeDistanceType.EA_EB]
    assert d == 2 or len(ends) > 3, "edges that are nearly parallel and touch with their ends"
    pairs = [*active.vv_collisions, *active.ev_collisions, *active.fv_collisions, *active.ee_collisions]
    squared = [c.compute_distance(c.dof(vertices, surface.mesh.edges, surface.mesh.faces)) for c in pairs]
    assert len(pairs) > 3
    np.testing.assert_allclose(np.linalg.norm(stencils.gaps(vertices), axis=1), np.sqrt(squared), rtol=1e-7)
    np.testing.assert_allclose(stencils.coefficients.sum(axis=1), 0.0, atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_the_stencils_hessian_is_exact_along_the_gap(d):
    """Moving one body along the common normal of two flat faces turns no gap: there the stencils leave nothing out."""
    low = np.r_[np.full(d - 1, 0.13), 1.0 + 0.6 * DHAT]
    space = LevelSpace(together(box(d, 3), box(d, 2, low=low, high=low + 0.5)), COMM)
    barrier = SurfaceBarrier(CollisionSurface(space, (), DHAT), DHAT, KAPPA)
    x = space.from_input(space.mesh.points)
    active, vertices = barrier.collisions(Positions(space, x))
    assert len(active) > 1
    up = (space.mesh.point_bodies[space.owned_points] == 1)[:, None] * np.eye(d)[-1]
    exact, ours = (
        up.ravel() @ hessian_of(barrier, space, x, mode).toarray() @ up.ravel() for mode in ("none", "clamp")
    )
    stencils = barrier.surface.stencils(active, vertices)
    moved = stencils.gaps(barrier.surface.vertices(Positions(space, up)))
    gaps = stencils.gaps(vertices)
    squared = np.einsum("kd,kd->k", gaps, gaps)
    along = np.einsum("kd,kd->k", gaps, moved) ** 2 / squared * barrier_law.curvature(squared / DHAT**2, DHAT, KAPPA)
    np.testing.assert_allclose(stencils.weights @ along, exact, rtol=1e-8)
    np.testing.assert_allclose(
        np.maximum(stencils.weights, 0.0) @ along, ours, rtol=1e-8
    )  # what weighs negatively is cut off


@pytest.mark.parametrize("d", [2, 3])
def test_the_stencils_hessian_is_positive(d):
    space, surface = two_boxes(d, obstacle=True)
    H = hessian_of(SurfaceBarrier(surface, DHAT, KAPPA), space, space.from_input(space.mesh.points)).toarray()
    assert np.linalg.eigvalsh(H)[0] > -1e-12 * np.abs(H).max()


@pytest.mark.parametrize("d", [2, 3])
def test_friction_is_ipctks(d):
    """Value and gradient through stencils against ipctk's own friction potential, some pairs sticking, some sliding."""
    space, surface = two_boxes(d, obstacle=True)
    barrier = SurfaceBarrier(surface, DHAT, KAPPA)
    eps_v, dt, mu = 0.1, 0.02, 0.4
    term = SurfaceFriction(barrier, mu, eps_v)
    x_t = Positions(space, space.from_input(space.mesh.points))
    barrier.begin_step(x_t, 0.0, dt)
    term.begin_step(x_t, 0.0, dt)
    active, vertices = barrier.collisions(x_t)
    lagged = ipctk.TangentialCollisions()
    stiffness = KAPPA / surface.primitives.scale**2  # the surface's primitives are scaled, and so are ipctk's areas
    theirs = ipctk.BarrierPotential(dhat=DHAT, stiffness=stiffness, use_physical_barrier=True)
    lagged.build(surface.mesh, vertices, active, theirs, mu)
    theirs = ipctk.FrictionPotential(eps_v=eps_v * dt)
    x = Positions(space, x_t.owned + 2.0 * eps_v * dt * np.random.default_rng(1).uniform(-1, 1, x_t.owned.shape))
    slip = np.asfortranarray(surface.vertices(x) - vertices)
    value, gradient = theirs(lagged, surface.mesh, slip), surface.rows_of(theirs.gradient(lagged, surface.mesh, slip))
    assert len(lagged) > 3
    np.testing.assert_allclose(term.value(x), value, rtol=1e-10)
    np.testing.assert_allclose(term.gradient(x), gradient, rtol=0.0, atol=1e-10 * np.abs(gradient).max())


def test_certified_and_additive_collision_detection_allow_similar_steps():
    """Tight inclusion allows about the same step as additive collision detection. The step never ends in an
    intersection.
    """
    space, additive = two_boxes(3)
    certified = CollisionSurface(space, (), DHAT, "tight-inclusion")
    x = Positions(space, space.from_input(space.mesh.points))
    fall = (space.mesh.point_bodies[space.owned_points] == 1)[:, None] * np.array([0.01, 0.02, -0.5])
    start, end = additive.vertices(x), additive.vertices(x.moved(1.0, fall))
    steps = [surface.max_step(start, end) for surface in (additive, certified)]
    assert 0.0 < steps[0] < 0.05
    np.testing.assert_allclose(steps[1], steps[0], rtol=0.2)
    assert not ipctk.has_intersections(certified.mesh, np.asfortranarray(start + steps[1] * (end - start)))


@pytest.mark.parametrize("ccd", ["additive", "tight-inclusion"])
@pytest.mark.parametrize("keep", [MIN_GAP_SHARE, SCRIPTED_GAP_SHARE])
def test_a_step_leaves_the_share_of_a_gap_that_it_is_asked_to_keep(ccd, keep):
    """A box falls straight down on a face 0.6 dhat below it. The remaining gap is the requested share, or a little more
    where collision detection is not precise enough.
    """
    low = np.array([0.2, 0.2, 1.0 + 0.6 * DHAT])
    space = LevelSpace(together(box(3, 2), box(3, 2, low=low, high=low + 0.5)), COMM)
    surface = CollisionSurface(space, (), DHAT, ccd)
    x = Positions(space, space.from_input(space.mesh.points))
    fall = np.where(space.mesh.point_bodies[:, None] == 1, [0.0, 0.0, -1.0], 0.0)
    barrier = SurfaceBarrier(surface, DHAT, KAPPA)
    step = barrier.max_step(x, space.from_input(fall), gap_share=keep)
    assert keep - 1e-9 <= barrier.min_gap(x.moved(step, space.from_input(fall))) / barrier.min_gap(x) <= keep + 0.02
