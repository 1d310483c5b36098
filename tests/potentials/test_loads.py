"""Forces, impulses, flows, pressures and what changes with time, against momentum balances, enclosed volumes
and expansions worked out by hand.
"""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from pdvol import meshes
from pdvol.geometry.closed_surfaces import enclosed_volume, pressed_facets
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly import kernels
from pdvol.potentials.loads import EnclosedPressure, point_shares
from pdvol.potentials.potential import Positions
from pdvol.scene import Flow, Force, Gravity, Impulse, NeoHookean, PointForce, Pressure, Solver, Support
from problems import make_scene, make_stepper, march, masses, take_step
from shapes import box, level, together
from taylor import check_term, hessian_of, smallest_eigenvalue, state

DIMENSIONS = [2, 3]
LOOSE = 1e-7  # m/s: the solver's tolerance, of speeds of order one
STIFF = NeoHookean(1e8, 0.3, 1000.0)


def shot(*loads, materials=(STIFF,), dt=0.01, steps=10):
    return make_scene(materials, dt=dt, steps=steps, loads=loads, solver=Solver(tolerance=LOOSE, linear="direct"))


def speeds(scene, mesh, steps, velocity=None):
    """Velocities (n, d) after each step, and the vertices' masses."""
    problem = make_stepper(scene, mesh)
    return [report.velocity for report in march(problem, steps, velocity=velocity)], masses(problem)


# ---- drag as a term


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_current_slows_and_carries(d):
    """A stiff unit cube in a flow along x: M (v+ - v)/dt = rho c/2 A (u - v+)^2 (implicit Euler), A = 2 d faces of area
    one.
    """
    rho, c, u, dt, start = 800.0, 0.5, 2.0, 0.05, 0.0
    mesh = box(d, 2)
    even = (u,) + (0.0,) * (d - 1)
    found, m = speeds(shot(Flow(even if d == 2 else lambda x, t: np.tile(even, (len(x), 1)), rho, c), dt=dt), mesh, 12)
    k, v = rho * c / 2 * 2 * d * dt / 1000.0, start
    for at in found:
        # k (u - v+)^2 = v+ - v: with w = u - v+ the positive root of k w^2 + w - (u - v) = 0.
        v = u - (np.sqrt(1 + 4 * k * (u - v)) - 1) / (2 * k)
        # Corners, edges and the inside are dragged differently and the cube is not quite rigid.
        assert (m @ at)[0] / m.sum() == pytest.approx(v, rel=2e-3)
    assert 0.4 * u < v < u


def test_a_huge_step_does_not_overshoot_the_flow():
    found, m = speeds(shot(Flow((3.0, 0.0), 1000.0, 5.0), dt=100.0), box(2, 2), 2)
    assert np.all(found[-1][:, 0] < 3.0 + 1e-6) and (m @ found[-1])[0] / m.sum() > 2.9


# ---- forces


@pytest.mark.parametrize("d", DIMENSIONS)
def test_forces_add_their_momentum_and_change_with_time_without_compiling(d, monkeypatch):
    """M (v_n - v_0) = dt sum F(t_k), whatever the deformation: a region's force, a point's and a changing gravity
    together.
    """
    compiled = []
    kept = kernels.kept
    monkeypatch.setattr(kernels, "kept", lambda *given: compiled.append(1) or kept(*given))
    F = lambda t: np.r_[np.cos(3 * t), np.zeros(d - 2), t]
    pull, hold = lambda t: 50.0 * F(t), np.linspace(5.0, -3.0, d)
    g = lambda t: -9.81 * F(t)[::-1]
    mesh = box(d, 2, jitter=0.1)
    scene = shot(
        Force(pull, lambda X: X[:, 0] > 0.4), PointForce(hold, (0.9,) * d), Gravity(g), materials=(NeoHookean(1e5),)
    )
    speeds(scene, mesh, 1)
    of_one_step = len(compiled)
    found, m = speeds(scene, mesh, 6)
    assert len(compiled) == 2 * of_one_step > 0
    total = np.zeros(d)
    for number, v in enumerate(found, 1):
        t = number * scene.dt
        total += scene.dt * (50.0 * F(t) + hold + m.sum() * g(t))
        np.testing.assert_allclose(m @ v, total, atol=1e-4 * np.abs(total).max())


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_point_force_acts_where_it_says(d):
    """Total and torque are those of the force at its point, on every mesh; a coarse one that ends short of it takes its
    nearest place.
    """
    at = np.full(d, 0.9) - 0.2 * np.arange(d)
    for n in (1, 2, 4):
        mesh = box(d, n)
        shares = point_shares(mesh, np.ones(len(mesh.points), dtype=bool), at)
        assert shares.min() >= 0.0 and np.count_nonzero(shares) <= d + 1
        np.testing.assert_allclose([shares.sum(), *(shares @ mesh.points)], [1.0, *at], atol=1e-12)
    beyond = at.copy()
    beyond[0] = 1.05
    np.testing.assert_allclose(
        point_shares(mesh, np.ones(len(mesh.points), dtype=bool), beyond) @ mesh.points, np.r_[1.0, at[1:]], atol=1e-12
    )
    two = together(mesh, box(d, 2))  # one upon the other: the second body's points alone are meant
    shares = point_shares(two, two.point_bodies == 1, at)
    assert np.all(two.point_bodies[shares > 0] == 1)


# ---- impulses


@pytest.mark.parametrize(("d", "time", "step"), [(2, 0.0, 1), (3, 0.01, 2), (2, 0.025, 3), (3, 0.03, 4), (2, 0.07, 8)])
def test_an_impulse_comes_once(d, time, step):
    """The momentum of the right half jumps in the step that its time falls in, or that begins then, and never again."""
    jump, mesh = np.linspace(1.0, 2.0, d), box(d, 2)
    push = Impulse(tuple(jump), time, lambda X: X[:, 0] > 0.4)
    found, m = speeds(shot(push, materials=(NeoHookean(1e5),)), mesh, 9)
    held = m @ (mesh.points[:, 0] > 0.4)
    for number, v in enumerate(found, 1):
        np.testing.assert_allclose(m @ v, held * jump * (number >= step), atol=1e-4 * held)


def test_an_impulse_in_a_halved_step_is_whole():
    """The halves of a step share its force. Only the half that contains the impulse has it, with twice the force."""
    scene, mesh = shot(Impulse((1.0, 0.0), 0.002)), box(2, 1)
    problem = make_stepper(scene, mesh)
    (load,) = [term for term in problem.potential.terms if term.name == "load"]
    x, total = Positions(problem.space, problem.space.from_input(mesh.points)), 0.0
    for t0, t1 in ((0.0, 0.005), (0.005, 0.01)):
        load.begin_step(x, t0, t1)
        total += (t1 - t0) * -load.gradient(x).sum(axis=0)[0]
    assert total == pytest.approx(masses(problem).sum(), rel=1e-12)


# ---- one body


def test_loads_on_one_body():
    mesh = together(box(2, 1), box(2, 1, low=3.0, high=4.0))
    for load in (
        Force((7.0, 0.0), body="body 1"),
        Impulse((7.0, 0.0), body="body 1"),
        PointForce((7.0, 0.0), (3.5, 3.5), body="body 1"),
        Flow((7.0, 0.0), body="body 1"),
    ):
        (v,), _ = speeds(shot(load, materials=(STIFF, STIFF)), mesh, 1)
        assert np.all(v[mesh.point_bodies == 0] == 0.0) and np.any(v[mesh.point_bodies == 1, 0] > 1e-5)


# ---- pressure in closed bodies

PRESSURE = 300.0


def ring(inner=0.5, outer=1.0, layers=6, around=48):
    """A disc with a hole."""
    angles = 2.0 * np.pi * np.arange(around) / around
    radii = np.linspace(inner, outer, layers + 1)
    points = (radii[:, None, None] * np.column_stack([np.cos(angles), np.sin(angles)])).reshape(-1, 2)
    i = np.arange(around)
    j = (i + 1) % around
    cells = []
    for low in range(0, layers * around, around):
        up = low + around
        cells += [np.column_stack([i + low, j + low, j + up]), np.column_stack([i + low, j + up, i + up])]
    return level(points, np.concatenate(cells))


def hollow():
    shape = meshes.hollow_ball(1.0, 0.3, 1)
    return level(shape.vertices, shape.cells)


def shapes_of(d):
    """A full body, and one with a cavity."""
    return box(d, 2, jitter=0.1), ring(around=12, layers=2) if d == 2 else hollow()


@pytest.mark.parametrize("d", DIMENSIONS)
def test_what_is_enclosed(d):
    full, open_inside = shapes_of(d)
    assert enclosed_volume(full.points, pressed_facets(full, 0)) == pytest.approx(full.volumes.sum(), rel=1e-12)
    facets = pressed_facets(open_inside, 0)
    cavity = 6 * np.sin(2 * np.pi / 12) * 0.25 if d == 2 else meshes.ball(0.7, 1)
    if d == 3:
        cavity = np.linalg.det(cavity.vertices[cavity.triangles]).sum() / 6
    assert enclosed_volume(open_inside.points, facets) == pytest.approx(cavity, rel=1e-12)
    assert enclosed_volume(open_inside.points + 1e3, facets) == pytest.approx(cavity, rel=1e-9)
    two = together(full, box(d, 1, 2.0, 4.0))
    assert enclosed_volume(two.points, pressed_facets(two, 1)) == pytest.approx(2.0**d, rel=1e-12)


def test_a_cavity_that_touches_the_outer_boundary_at_a_vertex():
    """Of 27 cubes the middle one is missing, and one at a corner: they share a vertex."""
    brick = meshes.brick((3.0, 3.0, 3.0), (3, 3, 3))
    cube = np.floor(brick.vertices[brick.cells].mean(axis=1) - brick.vertices.min(axis=0)).astype(int)
    missing = (cube == 1).all(axis=1) | (cube == 0).all(axis=1)
    mesh = level(brick.vertices, brick.cells[~missing])
    assert enclosed_volume(mesh.points, pressed_facets(mesh, 0)) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize(("shape", "pressure"), [(0, -PRESSURE), (1, PRESSURE)], ids=["full", "cavity"])
def test_derivatives(d, shape, pressure):
    """Exact and projected; the gradient by the whole size is p times d times the volume."""
    mesh = shapes_of(d)[shape]
    space = LevelSpace(mesh, MPI.COMM_SELF)
    term, x = EnclosedPressure(space, pressed_facets(mesh, 0), lambda t: pressure * t), state(space)
    term.begin_step(Positions(space, space.from_input(mesh.points)), 0.5, 1.0)
    assert term.pressure == pressure
    check_term(term, term.space, x, 1e-1, quadratic=d == 2)
    exact, clamped, whole = (hessian_of(term, term.space, x, name).toarray() for name in ("none", "clamp", "abs"))
    assert smallest_eigenvalue(exact) < 0.0
    assert min(map(smallest_eigenvalue, (clamped, whole))) >= -1e-10 * np.abs(exact).max()
    # Absolute values are twice the positive part, less the whole.
    np.testing.assert_allclose(whole, 2.0 * clamped - exact, atol=1e-10 * np.abs(exact).max())
    force, volume = -term.gradient(Positions(term.space, x)), enclosed_volume(term.space.to_input(x), term.facets)
    assert np.vdot(x, force) == pytest.approx(d * pressure * volume, rel=1e-11)


def settled(scene, mesh, steps=6):
    """Where pressure has led after steps so long that inertia does not matter."""
    stepper, x = make_stepper(scene, mesh), mesh.points
    for number in range(1, steps + 1):
        report = take_step(stepper, number, x, np.zeros_like(x))
        x = report.positions
    return x


def pressed(material, pressure, where, seconds=10.0):
    return make_scene(
        (material,),
        dt=seconds,
        loads=(Pressure("body 0", pressure),),
        supports=(Support(where),),
        solver=Solver(tolerance=1e-7 / seconds, linear="direct"),
    )


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_full_body_swells_evenly(d):
    """x = s X: the Cauchy stress (mu (s - 1/s) + lambda d ln s / s) / s^(d - 1) is p. The law is that of forms/."""
    material, pressure = NeoHookean(1e5, 0.3, 1000.0), 2e4
    stress = lambda s: (material.mu * (s - 1 / s) + material.lmbda * d * np.log(s) / s) / s ** (d - 1)
    s = brentq(lambda s: stress(s) - pressure, 1.0, 1.5)
    assert s > 1.05
    mesh = box(d, 2, jitter=0.1)
    corner = mesh.points[np.argmin(mesh.points.sum(axis=1))]
    x = settled(pressed(material, pressure, lambda X: np.linalg.norm(X - corner, axis=1) < 1e-9), mesh)
    sizes = [np.linalg.norm(y[:, None] - y[None], axis=2) for y in (mesh.points, x)]
    np.testing.assert_allclose(sizes[1], s * sizes[0], atol=1e-5)


def test_a_ring_widens_as_lame_says():
    """Plane strain, inner radius a, outer b: u(r) = p a^2 / (b^2 - a^2) (1 + nu) / E ((1 - 2 nu) r + b^2 / r)."""
    young, nu, a, b, pressure = 1e5, 0.3, 0.5, 1.0, 100.0
    mesh = ring(a, b, 8, 64)
    x = settled(pressed(NeoHookean(young, nu), pressure, lambda X: X[:, 0] > 0.9999), mesh, 3)
    moved = (x - x[:64].mean(axis=0)) - (mesh.points - mesh.points[:64].mean(axis=0))
    radius = np.linalg.norm(mesh.points, axis=1)
    outward = np.einsum("ki,ki->k", moved, mesh.points) / radius
    for r in (a, b):
        expected = pressure * a**2 / (b**2 - a**2) * (1 + nu) / young * ((1 - 2 * nu) * r + b**2 / r)
        assert outward[np.isclose(radius, r)].mean() == pytest.approx(expected, rel=0.02)
