"""Bodies that start away from rest: their energy, their release, and what holds them there, each worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

import pdvol
from pdvol.integrate.integrator import BDF2, advance
from pdvol.integrate.marches import Start, direct
from pdvol.levels.space import LevelSpace
from pdvol.potentials.potential import Positions
from pdvol.scene import lame
from pdvol.scene.point_caches import PointCache
from problems import block, elastic, make_model, make_scene, make_stepper, masses
from shapes import box, together

YOUNG, DENSITY = 1e5, 1000.0
TIGHT = pdvol.Solver(tolerance=1e-9, linear="direct")


def stretched(*factors):
    """A start that multiplies coordinates."""
    return lambda X: X * np.asarray(factors)


def starting(scene, *starts):
    """The scene with a start for each body."""
    return replace(scene, bodies=tuple(replace(b, start=s) for b, s in zip(scene.bodies, starts, strict=True)))


def march(stepper, steps):
    """The past after each step from the model's own start."""
    model = stepper.model
    past = Start.at_rest(model.start, model.velocity).past
    for report in direct(stepper, Start(0, past), steps):
        past = advance(stepper.integrator, past, report.positions, model.dt)
        yield past


def strained(space, material, positions):
    """The elastic energy [J] of a body at positions (n, d)."""
    return sum(term.value(Positions(space, space.from_input(positions))) for term in elastic(space, material))


@pytest.mark.parametrize("d", [2, 3])
def test_the_energy_of_a_stretched_start(d):
    material, (mu, lmbda) = pdvol.NeoHookean(YOUNG, 0.3, DENSITY), lame(YOUNG, 0.3)
    mesh = block((0.0,) * d, (1.0, 0.2, 0.2)[:d], (5, 2, 2)[:d], jitter=0.2)
    for s in (0.7, 1.6):
        model = make_model(starting(make_scene((material,)), stretched(s, *(1.0,) * (d - 1))), mesh)
        found = strained(LevelSpace(mesh, MPI.COMM_SELF), material, model.start)
        density = mu / 2 * (s**2 - 1) - mu * np.log(s) + lmbda / 2 * np.log(s) ** 2  # where one axis is stretched
        assert found == pytest.approx(density * mesh.volumes.sum(), rel=1e-9)


def test_a_stretched_bar_that_is_let_go_swings_as_waves_do():
    """Without Poisson's effect its cells are stretched along x alone. From both ends waves of the speed c = sqrt(E/rho)
    run inward that leave no strain, and material that moves by c times the strain: the length falls evenly, is that at
    rest at t = L / (2 c), where all energy is that of motion, and is shortest at L / c.
    """
    material, length, strain, speed = pdvol.NeoHookean(YOUNG, 0.0, DENSITY), 1.0, 0.01, np.sqrt(YOUNG / DENSITY)
    mesh, steps = block((0.0, 0.0), (length, 0.04), (100, 1)), 400
    scene = make_scene((material,), dt=length / speed / steps, steps=steps, solver=TIGHT)
    stepper = make_stepper(starting(scene, stretched(1.0 + strain, 1.0)), mesh, integrator=BDF2())
    pasts = list(march(stepper, steps))
    lengths = np.array([np.ptp(past[0].positions[:, 0]) for past in pasts])
    begin = strained(stepper.space, material, stepper.model.start)
    # On a mesh fronts are some cells wide, which rounds the turning point.
    for share, grown, off in ((0.25, 0.5, 0.02), (0.5, 0.0, 0.02), (0.75, -0.5, 0.02), (1.0, -1.0, 0.05)):
        assert (lengths[int(share * steps) - 1] / length - 1.0) / strain == pytest.approx(grown, abs=off)
    middle = pasts[steps // 2 - 1][0]
    kinetic = 0.5 * masses(stepper) @ np.sum(middle.velocity**2, axis=1)
    assert kinetic == pytest.approx(begin, rel=0.05)
    assert strained(stepper.space, material, middle.positions) < 0.05 * begin


@pytest.mark.parametrize("d", [2, 3])
def test_supports_hold_a_stretched_bar_where_it_starts(d):
    """Stretched by s along x, and by q across, where no stress acts across: mu (q - 1/q) + lmbda ln(s q^(d-1)) / q = 0.
    So it is in equilibrium, and its ends pull by mu (s - 1/s) + lmbda ln(s q^(d-1)) / s per area at rest.
    """
    (mu, lmbda), s = lame(YOUNG, 0.4), 1.5
    q = brentq(lambda q: mu * (q - 1 / q) + lmbda * np.log(s * q ** (d - 1)) / q, 0.3, 1.5, xtol=1e-15)
    pull = mu * (s - 1 / s) + lmbda * np.log(s * q ** (d - 1)) / s
    material, across = pdvol.NeoHookean(YOUNG, 0.4, DENSITY), (q,) * (d - 1)
    mesh = block((0.0,) * d, (1.0, 0.2, 0.2)[:d], (6, 2, 2)[:d])
    ends = (lambda X: X[:, 0] < 1e-9, lambda X: X[:, 0] > 1.0 - 1e-9)
    scene = make_scene((material,), dt=0.01, steps=5, solver=TIGHT, supports=tuple(map(pdvol.Support, ends)))
    stepper = make_stepper(starting(scene, stretched(s, *across)), mesh)
    for past in march(stepper, 5):
        np.testing.assert_allclose(past[0].positions, mesh.points * (s, *across), atol=1e-9)
    x = Positions(stepper.space, stepper.space.from_input(past[0].positions))
    forces = stepper.space.to_input(sum(term.gradient(x) for term in elastic(stepper.space, material)))
    for end, sign in zip(ends, (-1.0, 1.0), strict=True):
        expected = np.r_[sign * pull * 0.2 ** (d - 1), np.zeros(d - 1)]
        np.testing.assert_allclose(forces[end(mesh.points)].sum(axis=0), expected, atol=1e-6 * pull)


def test_motions_of_supports_begin_where_the_body_starts():
    """Chosen at rest; a function of the user's own gets the places at t = 0."""
    mesh = block((0.0, 0.0), (1.0, 0.2), (5, 1))
    end = lambda X: X[:, 0] > 1.0 - 1e-9
    own = lambda X, t: X * (1.0 + t)
    for motion, expected in ((pdvol.Translation((1.0, 0.0)), (2.5, 1.0)), (own, (3.0, 2.0))):
        scene = make_scene((pdvol.NeoHookean(YOUNG),), steps=1, supports=(pdvol.Support(end, motion=motion),))
        (held,) = make_model(starting(scene, lambda X: X * (1.5, 1.0) + (0.0, 1.0)), mesh).supports
        np.testing.assert_array_equal(np.flatnonzero(held.mask), np.flatnonzero(end(mesh.points)))
        np.testing.assert_allclose(held.at(1.0)[np.argmin(held.points[:, 1])], expected)


@pytest.mark.parametrize("d", [2, 3])
def test_a_spin_turns_about_the_centre_at_the_start(d):
    """And velocities that are functions are asked at rest positions."""
    mesh, shift = box(d, 2), np.arange(1.0, d + 1.0)
    body = pdvol.Body(("grid",), pdvol.NeoHookean(YOUNG), velocity=lambda X: X, spin=2.0 if d == 2 else (0.0, 0.0, 2.0))
    scene = starting(replace(make_scene((pdvol.NeoHookean(YOUNG),)), bodies=(body,)), lambda X: 3.0 * X + shift)
    model = make_model(scene, mesh)
    x, y = (model.start - (1.5 + shift)).T[:2]
    turning = np.column_stack([-2.0 * y, 2.0 * x, *([0.0 * x] * (d - 2))])
    np.testing.assert_allclose(model.velocity - mesh.points, turning, atol=1e-12)


def test_an_animation_is_taken_over_where_the_body_starts():
    mesh = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2, 2, 2))
    bent = lambda X: X + np.column_stack([X[:, 1] ** 2, 0.0 * X[:, 1:]])
    frames = np.array([bent(mesh.points), bent(mesh.points) + (0.0, 0.2, 0.0)]) - (0.0, 0.2, 0.0)
    cache = PointCache(frames, times=(0.0, 0.1), faces=mesh.boundary, tolerance=1e-6)
    body = pdvol.Body(("grid",), pdvol.NeoHookean(YOUNG), velocity=pdvol.TakeOver(cache), start=bent)
    model = make_model(replace(make_scene((pdvol.NeoHookean(YOUNG),)), bodies=(body,)), mesh)
    np.testing.assert_allclose(model.velocity, np.tile((0.0, 2.0, 0.0), (len(mesh.points), 1)), atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_springs_lead_to_the_nearest_place_at_the_start_and_have_that_length(d):
    """The second cube starts turned round above the first one, by half a turn about z: then its right side, at rest, is
    on the left. Seen from there the first cube's facets have their nearest places on what is its top at rest.
    """
    mesh = together(box(d, 2), box(d, 2, 2.0, 3.0))
    up = np.eye(d)[1]
    over = lambda X: np.column_stack([3.0 - X[:, 0], 3.0 - X[:, 1], *(X[:, 2:].T - 2.0)]) + 1.5 * up
    scene = make_scene(
        2 * (pdvol.NeoHookean(YOUNG),),
        attachments=(pdvol.Attachment("body 0", "body 1", lambda X: X[:, 1] > 1.0 - 1e-9, stiffness=10.0),),
    )
    (springs,) = make_model(starting(scene, None, over), mesh).springs
    np.testing.assert_allclose(springs.rest_length, 0.5, rtol=1e-12)
    ends = np.einsum("ka,kai->ki", springs.weights[:, d + 1 :], mesh.points[springs.points[:, d + 1 :]])
    np.testing.assert_allclose(ends[:, 1], 3.0, rtol=1e-12)
    begins = -np.einsum("ka,kai->ki", springs.weights[:, : d + 1], mesh.points[springs.points[:, : d + 1]])
    np.testing.assert_allclose(over(ends) - begins, np.tile(0.5 * up, (len(ends), 1)), atol=1e-12)


@pytest.mark.parametrize(
    ("stretch", "poisson", "integrator"),
    [
        (0.4, 0.0, "implicit_euler"),
        (0.4, 0.499, "bdf2"),
        (0.7, 0.3, "bdf2"),
        (1.1, 0.49, "implicit_euler"),
        (2.5, 0.0, "bdf2"),
        (2.5, 0.499, "implicit_euler"),
    ],
)
def test_a_stretch_that_keeps_its_volume_relaxes(poisson, stretch, integrator):
    """Inertia is negligible. Where strains are small, the stretch decays by 1 / e in one damping time."""
    damping, start = 0.1, np.array([stretch, stretch**-0.5, stretch**-0.5])
    material = pdvol.NeoHookean(1e6, poisson, 10.0, damping=damping)
    body = pdvol.Body((pdvol.meshes.brick((0.1,) * 3, (2,) * 3),), material, start=lambda X: X * start)
    for step in pdvol.march(pdvol.Scene((body,), dt=0.01, steps=40, integrator=integrator), levels=0):
        X, x = np.asarray(step.model.mesh.points), step.positions
        F = np.linalg.lstsq(X - X.mean(axis=0), x - x.mean(axis=0), rcond=None)[0]
        stretches = np.linalg.svd(F, compute_uv=False)
        left = (stretches[0 if stretch > 1.0 else 2] - 1.0) / (stretch - 1.0)
        if left < np.exp(-1.0):
            break
    assert 1.0 <= step.time / damping <= 3.0
