"""The contact energy is its definition in docs/contact.md, without jumps, and has these derivatives."""

import ipctk
import numpy as np
import pytest

import barrier_law
import contact_reference
from contact_reference import DHAT, KAPPA, crossing_tetrahedra, random_tetrahedra, surface_of, two_boxes
from pdvol.compiled import ffi
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.candidates import CONTACT, FADE
from pdvol.potentials.contact.friction import LaggedFriction
from pdvol.potentials.potential import Positions
from shapes import box, grid, level
from taylor import hessian_of


def at_rest(space):
    return Positions(space, space.from_input(space.mesh.points))


def jittered(space, size, seed):
    noise = size * np.random.default_rng(seed).uniform(-1, 1, space.mesh.points.shape)
    return space.from_input(space.mesh.points + noise)


# ---- what is summed over


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("obstacle", [False, True])
def test_the_energy_is_its_definition(d, obstacle):
    """In numpy, over all pairs: random states of two boxes, some nearly flat, some crumpled."""
    space, candidates = two_boxes(d, obstacle)
    barrier = ContactBarrier(candidates, KAPPA)
    for seed, size in enumerate((0.0, 1e-9, 0.1 * DHAT, DHAT, 3.0 * DHAT)):
        x = Positions(space, jittered(space, size, seed))
        expected = sum(contact_reference.brute_force_energy(candidates, candidates.surface.vertices(x)))
        assert expected > 0.0 or (d == 2 and size == 3.0 * DHAT)
        np.testing.assert_allclose(barrier.value(x), expected, rtol=1e-9)
        found = barrier.contacts(x)
        np.testing.assert_allclose(found.gaps_of(candidates.surface.vertices(x)), found.gaps, atol=1e-13)
        np.testing.assert_allclose(found.coefficients.sum(axis=1), 0.0, atol=1e-12)


def test_the_energy_of_tetrahedra_is_its_definition():
    """In all positions, even ones that intersect, with lengths of dhat: all kinds of contact, faded ones among them."""
    crossed = faded = 0
    for seed in range(120):
        space, candidates = random_tetrahedra(seed, size=(0.5 + seed % 5) * DHAT)
        x = at_rest(space)
        points, edges = contact_reference.brute_force_energy(candidates, candidates.surface.vertices(x))
        barrier = ContactBarrier(candidates, KAPPA)
        np.testing.assert_allclose(
            barrier.value(x), points + edges, rtol=1e-8, atol=1e-10 * (abs(points) + edges), err_msg=str(seed)
        )
        crossed += edges > 0.0
        faded += len(barrier.contacts(x).fades) > 0
    assert crossed > 60 and faded > 60


def tip_of(*corners):
    """A tetrahedron of these corners."""
    return level(np.array(corners, dtype=float), [[0, 1, 2, 3]])


UP, DOWN = (
    [[0, 0, 0], [0.5, -0.4, sign], [-0.5, -0.4, sign], [0, 0.6, sign]] for sign in (1.0, -1.0)
)  # regular tips, at the origin
FLAT = [[-1, -1, 0], [2, -1, 0], [-1, 2, 0], [0, 0, -2]]  # a face through it
ALONG, ACROSS = (
    [[-0.5, 0, 0], [0.5, 0, 0], [0, -0.6, -0.8], [0, 0.6, -0.8]],
    [[0, -0.5, 0], [0, 0.5, 0], [-0.6, 0, 0.8], [0.6, 0, 0.8]],
)


def one_contact(kind, below, above):
    """Two tetrahedra that meet in one contact of a kind, half a dhat apart, their positions, and ipctk's contacts."""
    space, candidates = surface_of(tip_of(*below), tip_of(*(np.array(above) + [0, 0, 0.5 * DHAT])))
    x, mesh, active = at_rest(space), contact_reference.mesh_of(candidates), ipctk.NormalCollisions()
    active.use_area_weighting = True
    active.collision_set_type = ipctk.NormalCollisions.CollisionSetType.IMPROVED_MAX_APPROX
    active.build(mesh=mesh, vertices=candidates.surface.vertices(x), dhat=DHAT, broad_phase=ipctk.BruteForce())
    found = [len(getattr(active, f"{name}_collisions")) for name in ("vv", "ev", "fv", "ee")]
    assert found == [kind == name for name in ("vv", "ev", "fv", "ee")]
    return space, candidates, x, mesh, active


def share_of(kind, mesh, active):
    """The weight of the one contact, over ipctk's: half the area of each vertex that meets the other body."""
    weight = sum(c.weight for c in getattr(active, f"{kind}_collisions"))
    tips = {"vv": (0, 4), "ev": (4,), "fv": (4,)}.get(kind)
    return 1.0 if tips is None else sum(0.5 * mesh.vertex_area(tip) for tip in tips) / weight


@pytest.mark.parametrize(
    "kind, below, above", [("vv", DOWN, UP), ("ev", ALONG, UP), ("fv", FLAT, UP), ("ee", ALONG, ACROSS)]
)
def test_one_contact_is_ipctks(kind, below, above):
    """Energy and forces of one weight are ipctk's for each kind. The weight is half the area of each vertex that meets
    the other body, or that of crossing edges, which ipctk has, too. So is friction, sticking and sliding, where both
    lag the same gap.
    """
    space, candidates, x_t, mesh, active = one_contact(kind, below, above)
    share = share_of(kind, mesh, active)
    barrier, vertices = ContactBarrier(candidates, KAPPA), candidates.surface.vertices(x_t)
    law = ipctk.BarrierPotential(dhat=DHAT, stiffness=KAPPA, use_physical_barrier=True)

    def assert_same(term, x, value, gradient):
        np.testing.assert_allclose(term.value(x), share * value, rtol=1e-10)
        gradient = share * candidates.surface.rows_of(gradient.reshape(-1, 3))
        np.testing.assert_allclose(term.gradient(x), gradient, rtol=0.0, atol=1e-10 * np.abs(gradient).max())

    assert_same(barrier, x_t, law(active, mesh, vertices), law.gradient(active, mesh, vertices))
    if kind in ("vv", "ev"):
        return
    eps_v, dt, mu = 0.1, 0.02, 0.4
    term, lagged = LaggedFriction(barrier, mu, eps_v), ipctk.TangentialCollisions()
    barrier.begin_step(x_t, 0.0, dt)
    term.begin_step(x_t, 0.0, dt)
    lagged.build(mesh, vertices, active, law, mu)
    theirs = ipctk.FrictionPotential(eps_v=eps_v * dt)
    assert len(lagged) == 1
    for slips in (0.3, 3.0):
        way = np.random.default_rng(1).uniform(-1, 1, x_t.owned.shape)
        x = Positions(space, x_t.owned + slips * eps_v * dt * way)
        slip = np.asfortranarray(candidates.surface.vertices(x) - vertices)
        assert_same(term, x, theirs(lagged, mesh, slip), theirs.gradient(lagged, mesh, slip))


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_a_flat_surface_does_not_touch_itself(d, jitter):
    """However small its cells are beside dhat: inside of faces, everything is counted as often as it is taken off
    again. Around edges of the box it touches itself.
    """
    n = 24 if d == 2 else 11
    cube = box(d, n, high=n * DHAT / 4.0)
    points = cube.points
    noise = jitter * DHAT / 4.0 * np.random.default_rng(0).uniform(-1, 1, points.shape)
    inner = (points > 1e-9) & (points < points.max() - 1e-9)
    space, candidates = surface_of(level(points + np.where(inner, noise, 0.0), cube.cells))
    x, barrier = at_rest(space), ContactBarrier(candidates, KAPPA)
    assert len(candidates.lists[0].pairs.listed[0]) == 0
    found = barrier.contacts(x)
    assert len(candidates.lists[0].pairs.listed[0]) > 100 and (d == 2 or len(found) > 10)
    flat = ((x.owned > 1.01 * DHAT) & (x.owned < points.max() - 1.01 * DHAT)).sum(axis=1) == d - 1
    assert flat.sum() > 2
    force = barrier_law.pressure(np.array(1.0 / 16.0), DHAT, KAPPA) * (DHAT / 4.0) ** (d - 1)
    np.testing.assert_allclose(barrier.gradient(x)[flat], 0.0, atol=1e-11 * force)


@pytest.mark.parametrize("name, kind", [("contact_t", CONTACT), ("fade_t", FADE)])
def test_contacts_have_one_layout_in_c_and_python(name, kind):
    assert ffi.sizeof(name) == kind.itemsize
    assert {field: ffi.offsetof(name, field) for field in kind.names} == {f: o for f, (_, o) in kind.fields.items()}
    assert len(ffi.typeof(name).fields) == len(kind.names)


# ---- no jumps


@pytest.mark.parametrize("angle", [0.0, 0.01, 0.025, 0.04, 0.5 * np.pi])
@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.2, 0.06, 0.0), (0.4, -0.03, 0.01), (0.0, 0.08, 0.005)])
def test_edges_that_slide_along_each_other(angle, way):
    space, candidates, points, _ = crossing_tetrahedra(angle)
    slide_upper(space, candidates, points, np.array(way))


@pytest.mark.parametrize("size, angle, seed", [(0.25, 0.2, 0), (1 / 7, 0.5, 2), (0.03, 1.0, 7), (0.03, 0.02, 3)])
def test_crushed_edges_that_slide_along_each_other(size, angle, seed):
    """Turned any way round. Lengths at rest do not say which edges are nearly parallel."""
    space, candidates, points, frame = crossing_tetrahedra(angle, size, seed)
    slide_upper(space, candidates, points, size * np.array([1.0, 0.3, 0.0]) @ frame.T)


def slide_upper(space, candidates, points, way):
    move = np.where(space.mesh.point_bodies[:, None] == 1, 0.7 * way, 0.0)
    return contact_reference.check_slide(space, candidates, points - move, points + move)


@pytest.mark.parametrize("swap", [False, True])
def test_edges_that_turn_until_they_are_parallel(swap):
    """Through the angle at which they fade, and past the parallel position."""
    space, candidates, _, _ = crossing_tetrahedra(0.0)
    before, after = (crossing_tetrahedra(angle)[2] for angle in (0.06, -0.05))
    if swap:
        before, after = (points[:, [1, 2, 0]] for points in (before, after))
    contact_reference.check_slide(space, candidates, before, after)


def bent(d, n, angle):
    """A plate of 2 n cells whose right half is bent downwards by an angle, below a small box whose lower face is a
    third of a dhat above the plate.
    """
    ticks = [np.linspace(-0.3, 0.3, 2 * n + 1), *[np.linspace(-0.21, 0.2, n + 1)] * (d - 2), np.linspace(-0.2, 0.0, 2)]
    plate = grid(*ticks)
    points = plate.points.copy()
    points[:, -1] -= np.tan(angle) * np.maximum(points[:, 0], 0.0)
    return level(points, plate.cells)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("angle", [0.0, 0.3, -1.0])
@pytest.mark.parametrize("corner", [False, True])
def test_a_body_that_slides_over_a_surface(d, angle, corner):
    """Over the vertices and edges of a flat, a convex and a concave surface: a box, or a box on its corner."""
    body = box(d, 2, low=-0.05, high=0.05)
    points = body.points
    if corner:
        turn = np.linalg.qr(np.random.default_rng(1).standard_normal((d, d)))[0]
        points = points @ turn.T
    start = np.r_[np.full(d - 1, -0.13), 0.0]
    end = np.r_[0.15, np.full(d - 2, 0.07), 0.0]
    points = points + start
    points[:, -1] += 0.4 * DHAT - points[:, -1].min()
    rise = max(0.0, -np.tan(angle)) * (end[0] + 0.1)
    space, candidates = surface_of(bent(d, 3, angle), level(points, body.cells))
    move = np.where(space.mesh.point_bodies[:, None] == 1, end - start + np.r_[np.zeros(d - 1), rise], 0.0)
    contact_reference.check_slide(space, candidates, space.mesh.points, space.mesh.points + move, sections=36)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(2))
def test_a_body_that_deforms(d, seed):
    """Straight ways between two random states of two boxes and an obstacle, contact within bodies included."""
    space, candidates = two_boxes(d, obstacle=True)
    rng = np.random.default_rng(seed)
    start, end = (space.mesh.points + 0.3 * DHAT * rng.uniform(-1, 1, space.mesh.points.shape) for _ in range(2))
    contact_reference.check_slide(space, candidates, start, end, parts=50, sections=36)


def test_a_surface_that_folds_itself():
    """A fine strip, bent until its halves touch: contacts within a body begin without a jump."""
    n, length = 24, 24 * DHAT
    strip = grid(np.linspace(-0.5, 0.5, n + 1) * length, [0.0, 0.3 * DHAT])
    space, candidates = surface_of(strip)
    x, y = strip.points.T

    def rolled(angle):
        radius = length / angle
        return np.column_stack([(radius - y) * np.sin(x / radius), radius - (radius - y) * np.cos(x / radius)])

    for one, other in ((5.2, 5.7), (5.7, 6.2)):
        contact_reference.check_slide(space, candidates, rolled(one), rolled(other), parts=100, sections=36)


# ---- derivatives


def check_derivatives_at(space, candidates, points, seed, length):
    """Gradient and unprojected Hessian along a random direction, by central differences over some lengths (energies are
    twice differentiable but at some places); projected Hessians are positive, and no less than the exact one.
    """
    barrier = ContactBarrier(candidates, KAPPA)
    x, way = space.from_input(points), np.random.default_rng(seed).uniform(-1, 1, points.shape)
    exact = hessian_of(barrier, space, x, "none").toarray()
    force, along = barrier.gradient(Positions(space, x)), (exact @ way.ravel()).reshape(way.shape)
    slopes, changes = [], []
    for h in length * np.array([1.0, 0.1, 0.01]):
        ahead, back = (Positions(space, x + s * h * way) for s in (1.0, -1.0))
        slopes.append((barrier.value(ahead) - barrier.value(back)) / (2.0 * h))
        changes.append((barrier.gradient(ahead) - barrier.gradient(back)) / (2.0 * h))
    off = np.abs(np.array(slopes) - np.vdot(force, way)).min() / np.abs(force).sum()
    assert off < 1e-6, f"gradient: {off:.1e}"
    off = np.abs(np.array(changes) - along).max(axis=(1, 2)).min() / np.abs(along).max()
    assert off < 1e-6, f"Hessian: {off:.1e}"
    for mode in ("clamp", "abs"):
        convex = hessian_of(barrier, space, x, mode).toarray()
        tolerance = 1e-10 * max(np.abs(convex).max(), np.abs(exact).max())
        assert np.linalg.eigvalsh(convex)[0] > -tolerance, f"{mode}: not positive"
        assert np.linalg.eigvalsh(convex - exact)[0] > -tolerance, f"{mode}: less than the exact one"


def test_gradient_and_hessian_of_tetrahedra():
    """All kinds of contact and of fades, each by itself in some of the states. There is no net force and torque."""
    seen, faded = 0, 0
    for seed in range(100):
        space, candidates = random_tetrahedra(seed, size=(0.5 + seed % 4) * DHAT)
        found = ContactBarrier(candidates, KAPPA).contacts(at_rest(space))
        if not len(found) or np.linalg.norm(found.gaps, axis=1).min() < 0.05 * DHAT:
            continue
        check_derivatives_at(space, candidates, space.mesh.points, seed, 1e-4 * DHAT)
        x, g = at_rest(space).owned, ContactBarrier(candidates, KAPPA).gradient(at_rest(space))
        np.testing.assert_allclose(g.sum(axis=0), 0.0, atol=1e-9 * np.abs(g).max())
        np.testing.assert_allclose(x.T @ g - g.T @ x, 0.0, atol=1e-9 * DHAT * np.abs(g).max())
        seen, faded = seen + 1, faded + (len(found.fades) > 0)
    assert seen > 26 and faded > 13


@pytest.mark.parametrize("angle", [0.005, 0.01, 0.02, 0.03])
@pytest.mark.parametrize("shift", [0.0, 0.31, -0.2])
def test_gradient_and_hessian_of_edges_that_are_nearly_parallel(angle, shift):
    space, candidates, points, _ = crossing_tetrahedra(angle, seed=3)
    points[4:] += shift * (points[1] - points[0])
    assert len(ContactBarrier(candidates, KAPPA).contacts(Positions(space, space.from_input(points))).fades)
    check_derivatives_at(space, candidates, points, 0, 1e-3 * DHAT * angle)


def test_a_rank_without_rows_of_any_contact_adds_nothing():
    """Contacts are those of all ranks, but blocks only those of a rank's own rows; there may be none."""
    space, _ = two_boxes(2)
    blocks = HessianBlocks(BlockPattern(space))
    none = np.zeros(0, dtype=np.int64)
    blocks.add_pairs(none, none, np.zeros((0, 2, 2)))
    assert blocks.finite() and blocks.count == 0 and len(blocks.merged(None)[2]) == blocks.pattern.count
