"""The prediction of which contacts stick: its forces and Hessians, and what it does to Newton's method."""

import numpy as np
import pytest
from test_derivatives import DT, EPS_V, MU, half_space, near_plane, near_surfaces, spaces  # noqa: F401

from pdvol.potentials.contact.friction import LaggedFriction
from pdvol.potentials.potential import Positions
from pdvol.scene import Barrier, Friction, Gravity, NeoHookean, Plane, Solver
from pdvol.solve.newton import Newton
from problems import block, make_scene, make_stepper, take_step
from taylor import hessian_of

EPS = EPS_V * DT
GROUNDS = ["plane", "surface"]


def friction(spaces, d, ground):  # noqa: F811
    """The space, friction lagged at owned positions x_t, and x_t."""
    space = spaces[d]
    if ground == "plane":
        barrier, term = half_space(space, d)
        x_t = near_plane(space)
    else:
        space, barrier = near_surfaces(d)
        term, x_t = LaggedFriction(barrier, MU, EPS_V), space.from_input(space.mesh.points)
    for part in (barrier, term):
        part.begin_step(Positions(space, x_t), 0.0, DT)
    return space, term, x_t


def slips_of(term, x):
    """(k, d) slips [m] of the contacts, across their gaps."""
    moved, gaps = term.contacts.gaps_of(term.surface.vertices(x) - term._start), term.contacts.gaps
    along = np.sum(moved * gaps, axis=1) / np.sum(gaps**2, axis=1)
    return moved - along[:, None] * gaps


def moved(space, x_t, slip):
    """Each body slips by as much against what is below it."""
    bodies = space.mesh.point_bodies[space.owned_points]
    return Positions(space, x_t + (1.0 + bodies)[:, None] * slip * EPS * np.eye(space.dim)[0])


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("ground", GROUNDS)
def test_a_prediction_follows_from_where_a_direction_ends(spaces, d, ground):  # noqa: F811
    space, term, x_t = friction(spaces, d, ground)
    at = lambda slip: moved(space, x_t, slip)
    pushed = term.forces > 0.0
    assert not term.predict(at(5.0), at(2.0)), "it goes on sliding"
    assert not term.predict(at(0.5), at(-3.0)), "Newton knows the stiffness of what sticks"
    assert term.predict(at(5.0), at(-2.0)) and term.sticks[pushed].all(), "it has turned round"
    assert term.predict(at(5.0), at(0.3)) and not term.sticks[~pushed].any(), "it stops"
    term.forget_prediction()
    assert np.all(term.predicted_change(at(5.0)) == 0.0)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("ground", GROUNDS)
def test_predicted_forces_are_linear_with_the_predicted_hessian(spaces, d, ground):  # noqa: F811
    """2 / eps times the slip."""
    space, term, x_t = friction(spaces, d, ground)
    term.forces[:] = np.abs(term.forces)  # Hessians leave out what weighs negatively
    start = moved(space, x_t, 5.0)
    term.predict(start, moved(space, x_t, -2.0))
    change = np.random.default_rng(1).uniform(-EPS, EPS, x_t.shape)
    forces = lambda x: term.gradient(x) + term.predicted_change(x)
    hessian = hessian_of(term, space, start.owned)
    scale = np.abs(forces(start)).max()
    assert scale > 0.0
    np.testing.assert_allclose(
        forces(start.moved(1.0, change)) - forces(start), (hessian @ change.ravel()).reshape(-1, d), atol=1e-7 * scale
    )


def spun():
    """Newton iterations, backtracks and last positions of a spinning jelly block that falls onto a floor."""
    scene = make_scene(
        (NeoHookean(1e4, 0.4, 1000.0),),
        dt=0.01,
        loads=(Gravity((0.0, 0.0, -9.81)),),
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), name="floor"),),
        contact=(Barrier(dhat=2e-3), Friction(0.3, eps_v=1e-3)),
        solver=Solver(tolerance=1e-4),
    )
    mesh = block((0.0, 0.0, 4e-3), (0.3, 0.3, 0.204), (4, 4, 4))
    problem, x, reports = make_stepper(scene, mesh), mesh.points, []
    v = np.array([2.0, 0.0, -1.5]) + np.cross([0.0, -10.0, 0.0], x - x.mean(axis=0))
    for number in range(1, 31):
        reports.append(take_step(problem, number, x, v))
        v, x = (reports[-1].positions - x) / scene.dt, reports[-1].positions
    return sum(r.newton_iterations for r in reports), sum(r.backtracks for r in reports), x


def test_predictions_spare_backtracks_and_leave_the_minimum_where_it_is(monkeypatch):
    """16 backtracks without them, none with them."""
    fewer, none, y = spun()
    monkeypatch.setattr(Newton, "_predict_friction", lambda *_: None)
    iterations, backtracks, x = spun()
    assert backtracks > 8 and none < 0.25 * backtracks and fewer < iterations
    assert np.abs(x - y).max() < 1e-6
