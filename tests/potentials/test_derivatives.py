"""Second-order derivative checks of every term and law in 2D and 3D."""

import ipctk
import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact_reference import mesh_of
from pdvol.forms.inertia import inertia
from pdvol.levels.obstacles import Obstacle, plane_obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.build import Terms
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.candidates import Candidates
from pdvol.potentials.contact.friction import LaggedFriction
from pdvol.potentials.contact.surface import ContactSurface
from pdvol.potentials.loads import assemble_mass, gravity_load
from pdvol.potentials.potential import Positions
from pdvol.scene import FixedCorotational, NeoHookean, Plane, Still, StVenantKirchhoff, Translation
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.report import Stopwatch
from problems import elastic, polyline, tetrahedron
from shapes import box, grid, together
from taylor import check_derivatives, check_term, hessian_of, smallest_eigenvalue, state

COMM = MPI.COMM_SELF
DIMENSIONS = [2, 3]
LAWS = [NeoHookean, StVenantKirchhoff, FixedCorotational]
YOUNG, POISSON, DENSITY = 3.0, 0.3, 2.0
DHAT, KAPPA, MU, EPS_V, DT = 0.05, 0.3, 0.4, 0.1, 0.02
ROUND = 1e-12  # relative size of what should cancel


@pytest.fixture(scope="module")
def spaces():
    """A jittered cube of 2 boxes a side in each dimension."""
    return {d: LevelSpace(box(d, 2, jitter=0.1, seed=d), COMM) for d in DIMENSIONS}


def densities(space):
    return np.full(len(space.mesh.cells), DENSITY)


def dense(rows):
    return rows.toarray()


# ---- elasticity, loads, inertia


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("d", DIMENSIONS)
def test_elastic(spaces, d, law):
    (term,) = elastic(spaces[d], law(YOUNG, POISSON, DENSITY))
    check_term(term, spaces[d], state(spaces[d]), 1e-2)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_elastic_of_two_bodies(d):
    """Parameters are those of each cell's own body."""
    space = LevelSpace(together(box(d, 1), box(d, 1, low=2.0, high=3.0)), COMM)
    materials = (NeoHookean(YOUNG, POISSON), NeoHookean(10.0 * YOUNG, POISSON))
    (term,) = elastic(space, *materials)
    x = state(space)
    check_term(term, space, x, 1e-2)
    # Energies are proportional to Young's modulus and add up: E_both(y, 10 y) = E_first(y) + 10 E_second(y).
    alone = [
        elastic(space, NeoHookean(a, POISSON), NeoHookean(b, POISSON))[0].value(Positions(space, x))
        for a, b in ((YOUNG, YOUNG), (2 * YOUNG, YOUNG))
    ]
    first = alone[1] - alone[0]
    np.testing.assert_allclose(term.value(Positions(space, x)), first + 10.0 * (alone[0] - first), rtol=1e-12)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_gravity(spaces, d):
    term = gravity_load(spaces[d], densities(spaces[d]), np.linspace(1.0, -9.81, d))
    check_term(term, spaces[d], state(spaces[d]), 1e-2, linear=True)
    # Total force: density times the unit cube's (jittered) volume times the acceleration.
    np.testing.assert_allclose(
        term.force.sum(axis=0), DENSITY * spaces[d].mesh.volumes.sum() * np.linspace(1.0, -9.81, d), rtol=ROUND
    )


@pytest.mark.parametrize("d", DIMENSIONS)
def test_inertia(spaces, d):
    space = spaces[d]
    mass = assemble_mass(space, densities(space))
    assert mass.min() > 0.0
    np.testing.assert_allclose(mass.sum(axis=0), DENSITY * space.mesh.volumes.sum(), rtol=ROUND)
    potential = IncrementalPotential(space, Terms(mass, (), ()), Stopwatch())
    x = state(space)
    potential.begin_step(Positions(space, x), x + 0.3 * state(space, seed=5), DT**2, 0.0, DT)
    check_term(potential, space, x, 1e-1, quadratic=True)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_inertia_is_the_form_that_dolfinx_assembles(spaces, d):
    """Value, gradient and Hessian of the march's inertia, with another density in each cell: vertex quadrature lumps
    the mass matrix, so that its other entries are zero.
    """
    space = spaces[d]
    rho = np.random.default_rng(1).uniform(1.0, 5.0, len(space.mesh.cells))
    potential = IncrementalPotential(space, Terms(assemble_mass(space, rho), (), ()), Stopwatch())
    x = Positions(space, state(space))
    potential.begin_step(x, x.owned + 0.3 * state(space, seed=5), DT**2, 0.0, DT)
    u = space.function(space.to_input(x.owned - potential.x_hat), "u")
    energy = inertia(space.cell_function(rho, "density"), u, space.domain)
    force = ufl.derivative(energy, u)
    mass = fem.assemble_matrix(fem.form(ufl.derivative(force, u))).to_dense()
    assert potential.value(x) == pytest.approx(fem.assemble_scalar(fem.form(energy)), rel=ROUND)
    assembled = fem.assemble_vector(fem.form(force)).array.reshape(-1, d)
    np.testing.assert_allclose(potential.gradient(x), assembled, rtol=ROUND, atol=ROUND)
    np.testing.assert_allclose(
        hessian_of(potential, space, x.owned).toarray(), mass, rtol=ROUND, atol=ROUND * mass.max()
    )
    np.testing.assert_allclose(mass, np.diag(mass.diagonal()), atol=ROUND * mass.max())


@pytest.mark.parametrize("d", DIMENSIONS)
def test_the_whole_potential(spaces, d):
    """Inertia plus dt^2 times the terms, with a large dt so that both matter."""
    space = spaces[d]
    terms = (
        *elastic(space, NeoHookean(YOUNG, POISSON, DENSITY)),
        gravity_load(space, densities(space), np.eye(d)[-1]),
        half_space(space, d)[0],
    )
    potential = IncrementalPotential(space, Terms(assemble_mass(space, densities(space)), terms, ()), Stopwatch())
    x = near_plane(space)
    potential.begin_step(Positions(space, x), x - 0.1, 1.0, 0.0, 1.0)
    check_term(potential, space, x, 2e-3)


def barrier_of(space, *obstacles):
    """The barrier of a level with obstacles."""
    return ContactBarrier(Candidates(ContactSurface(space, obstacles), DHAT), KAPPA)


# ---- half-spaces


STILL = Still()


def half_space(space, d, motion=STILL):
    """A plane at height zero and a slanted one, far away."""
    planes = (Plane((0.0,) * d, tuple(np.eye(d)[-1]), motion), Plane((0.0,) * (d - 1) + (-50.0,), (1.0,) * d))
    barrier = barrier_of(space, *map(plane_obstacle, planes))
    return barrier, LaggedFriction(barrier, MU, EPS_V)


def near_plane(space, share=0.5, spread=0.3):
    """The body's lowest vertices at about `share` of dhat above height zero."""
    rng = np.random.default_rng(3)
    x = space.from_input(space.mesh.points).copy()
    low = x[:, -1] < 0.2
    x[low, -1] = DHAT * (share + spread * rng.uniform(-1, 1, low.sum()))
    return x


@pytest.mark.parametrize("d", DIMENSIONS)
def test_half_space_barrier(spaces, d):
    space = spaces[d]
    term, _ = half_space(space, d)
    x = near_plane(space)
    assert term.count(Positions(space, x)) == np.sum(x[:, -1] < DHAT) > 1
    check_term(term, space, x, 2e-3)
    assert smallest_eigenvalue(dense(hessian_of(term, space, x))) >= 0.0


@pytest.mark.parametrize("d", DIMENSIONS)
def test_half_space_barrier_follows_a_moving_plane(spaces, d):
    """A plane at rest below reach rises by 0.7 dhat; values are those of the body lowered by as much."""
    space = spaces[d]
    rise = 0.7 * DHAT
    term, _ = half_space(space, d, Translation(tuple(rise * np.eye(d)[-1])))
    x = near_plane(space, share=1.4, spread=0.2)
    assert term.count(Positions(space, x)) == 0
    term.move_obstacles(1.0)
    check_term(term, space, x, 2e-3)
    still, _ = half_space(space, d)
    np.testing.assert_allclose(
        term.value(Positions(space, x)), still.value(Positions(space, x - rise * np.eye(d)[-1])), rtol=1e-10
    )


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize("share", [0.5, 3.0], ids=["stick", "slip"])
@pytest.mark.parametrize("ground", [0.0, 0.4], ids=["still", "moving"])
def test_half_space_friction(spaces, d, share, ground):
    """Slip of `share` times eps = eps_v dt, relative to a plane that moves along itself."""
    space = spaces[d]
    speed = ground * np.eye(d)[0]
    barrier, term = half_space(space, d, Translation(tuple(speed)))
    x_t = near_plane(space)
    barrier.begin_step(Positions(space, x_t), 1.0, 1.0 + DT)
    term.begin_step(Positions(space, x_t), 1.0, 1.0 + DT)
    assert barrier.count(Positions(space, x_t)) > 1
    barrier.move_obstacles(1.0 + DT)
    slip = share * EPS_V * DT * np.eye(d)[0]
    x = x_t + DT * speed + slip + 0.2 * EPS_V * DT * np.random.default_rng(4).uniform(-1, 1, x_t.shape)
    check_term(
        term, space, x, 0.02 * EPS_V * DT, linear=d == 2 and share > 1.0
    )  # on a line, sliding forces are constant
    stiffness = np.abs(term.gradient(Positions(space, x))).max() / (EPS_V * DT)  # on a line, sliding forces have none
    assert smallest_eigenvalue(dense(hessian_of(term, space, x))) >= -ROUND * stiffness
    # Forces of sliding vertices are mu times the normal force, against the slip.
    if share > 1.0:
        normal = barrier.gradient(Positions(space, x_t))[:, -1]
        np.testing.assert_allclose(
            np.linalg.norm(term.gradient(Positions(space, x)), axis=1), MU * np.abs(normal), rtol=1e-10
        )
        assert np.all(term.gradient(Positions(space, x))[normal != 0.0, 0] > 0.0)


# ---- surfaces


def near_surfaces(d):
    """Two blocks, the upper one smaller and shifted, half a dhat apart, on an obstacle half a dhat below; and the upper
    one's points.
    """
    lower = box(d, 2, jitter=0.05, seed=1)
    top = lower.points[:, -1].max()
    upper = grid(
        *[np.linspace(0.13, 0.71, 3)] * (d - 1), top + 0.5 * DHAT + np.linspace(0.03, 0.4, 2), jitter=0.02, seed=2
    )
    lift = top + 0.5 * DHAT - upper.points[:, -1].min()
    upper = type(upper)(upper.points + lift * np.eye(d)[-1], upper.cells, upper.bodies, upper.regions)
    bottom = lower.points[:, -1].min() - 0.4 * DHAT
    if d == 2:
        obstacle = polyline([[-1.0, bottom - 1.0], [3.0, bottom - 1.0], [0.41, bottom]])
    else:
        obstacle = tetrahedron(
            [[-1.0, -1.0, bottom - 1.0], [3.0, 0.0, bottom - 1.0], [0.0, 3.0, bottom - 1.0], [0.37, 0.41, bottom]]
        )
    space = LevelSpace(together(lower, upper), COMM)
    return space, barrier_of(space, Obstacle("obstacle", "mesh" if space.dim == 3 else "polyline", *obstacle))


@pytest.fixture(scope="module")
def touching():
    return {d: near_surfaces(d) for d in DIMENSIONS}


@pytest.mark.parametrize("d", DIMENSIONS)
def test_surface_barrier(touching, d):
    space, term = touching[d]
    x = space.from_input(space.mesh.points)
    positions = Positions(space, x)
    assert term.count(positions) > 2
    reached = term.gradient(positions)[:, -1] != 0.0
    bodies = space.mesh.point_bodies[space.owned_points]
    assert np.any(reached & (bodies == 0) & (x[:, -1] < 0.5)), "the obstacle is not felt"
    assert np.any(reached & (bodies == 1)), "the bodies do not feel each other"
    check_term(term, space, x, 2e-4)
    projected = dense(hessian_of(term, space, positions.owned))
    assert smallest_eigenvalue(projected) >= -ROUND * np.abs(projected).max()


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize("share", [0.4, 4.0], ids=["stick", "slip"])
def test_surface_friction(touching, d, share):
    """Slopes of value and gradient; the Hessian leaves out what weighs negatively."""
    space, barrier = touching[d]
    term = LaggedFriction(barrier, MU, EPS_V)
    x_t = space.from_input(space.mesh.points)
    barrier.begin_step(Positions(space, x_t), 0.0, DT)
    term.begin_step(Positions(space, x_t), 0.0, DT)
    assert barrier.count(Positions(space, x_t)) > 2
    bodies = space.mesh.point_bodies[space.owned_points]
    # The lower body slips on the obstacle, the upper one on the lower one as much again: both by share * eps.
    x = x_t + np.where(bodies == 0, 1.0, 2.0)[:, None] * share * EPS_V * DT * np.eye(d)[0]

    constant = d == 2 and share > 1.0  # on a line, sliding forces are constant
    check_term(term, space, x, 0.02 * EPS_V * DT, linear=constant)
    own = dense(hessian_of(term, space, x))
    stiffness = np.abs(term.gradient(Positions(space, x))).max() / (EPS_V * DT)  # on a line, sliding forces have none
    assert smallest_eigenvalue(own) >= -ROUND * stiffness
    if d == 2:
        np.testing.assert_allclose(own, dense(hessian_of(term, space, x, "none")), atol=ROUND * stiffness)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_contact_forces_balance(touching, d):
    """Between bodies: lower minus obstacle's share; a lone pair of bodies has no net force and no net torque."""
    space, _ = touching[d]
    barrier = barrier_of(space)
    x = space.from_input(space.mesh.points)
    g = barrier.gradient(Positions(space, x))
    scale = np.abs(g).max()
    assert scale > 0.0
    np.testing.assert_allclose(g.sum(axis=0), 0.0, atol=ROUND * scale)
    np.testing.assert_allclose(
        x.T @ g - g.T @ x, 0.0, atol=1e-10 * scale
    )  # torques: the antisymmetric part of sum x (x) g


# ---- the half-space law is the surfaces' law


def test_half_space_barrier_is_ipctks():
    """ipctk's plane-vertex barrier, built through Candidates: `NormalCollisions.build(mesh, ...)` misses planes beyond
    dhat / 2.
    """
    space = LevelSpace(box(3, 2, jitter=0.1, seed=3), COMM)
    x = near_plane(space, share=0.55, spread=0.4)
    positions = Positions(space, x)
    bare = barrier_of(space)
    surface = bare.surface
    point, normal = np.array([0.1, -0.2, 0.0]), np.array([0.01, -0.004, 1.0])
    normal = normal / np.linalg.norm(normal)
    mesh = mesh_of(bare.candidates)
    mesh.planes = [ipctk.Hyperplane(normal, point)]
    vertices = surface.vertices(positions)
    candidates = ipctk.Candidates()
    candidates.build(mesh=mesh, vertices=vertices, inflation_radius=DHAT, broad_phase=ipctk.LBVH())
    active = ipctk.NormalCollisions()
    active.use_area_weighting = True
    active.collision_set_type = ipctk.NormalCollisions.CollisionSetType.IMPROVED_MAX_APPROX
    active.build(candidates=candidates, mesh=mesh, vertices=vertices, dhat=DHAT)
    theirs = ipctk.BarrierPotential(dhat=DHAT, stiffness=KAPPA, use_physical_barrier=True)
    ours = barrier_of(space, plane_obstacle(Plane(tuple(point), tuple(normal))))
    assert len(active) == ours.count(positions) > 3
    gaps = np.linalg.norm(ours.contacts(positions).gaps, axis=1)
    assert np.any((gaps > DHAT / 2) & (gaps < DHAT)), "none beyond half of dhat"
    np.testing.assert_allclose(ours.value(positions), theirs(active, mesh, vertices), rtol=1e-10)
    gradient = surface.rows_of(theirs.gradient(active, mesh, vertices).reshape(-1, 3))
    np.testing.assert_allclose(ours.gradient(positions), gradient, rtol=1e-9, atol=1e-12 * np.abs(gradient).max())


def test_the_check_notices_a_wrong_gradient():
    x = np.linspace(0.1, 1.0, 6).reshape(3, 2)
    value, gradient = lambda x: np.sum(x**4), lambda x: 4.0 * x**3
    hessian = lambda x: np.diag(12.0 * x.ravel() ** 2)
    check_derivatives(value, gradient, hessian, x, 1e-2)
    with pytest.raises(AssertionError, match="gradient: slope"):
        check_derivatives(value, lambda x: 4.04 * x**3, hessian, x, 1e-2)
    with pytest.raises(AssertionError, match="Hessian: slope"):
        check_derivatives(value, gradient, lambda x: 1.01 * hessian(x), x, 1e-2)
    with pytest.raises(AssertionError, match="not active"):
        check_derivatives(lambda x: 0.0, np.zeros_like, None, x, 1e-2)
