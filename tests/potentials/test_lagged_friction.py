"""The compiled loops of friction beside the same in numpy: the smoothed law, forces and stiffness, and predictions of
which contacts stick; what predictions do to Newton's method.
"""

from itertools import product

import numpy as np
import pytest

from pdvol.potentials.contact.friction import LaggedFriction
from pdvol.potentials.potential import Positions
from pdvol.scene import Barrier, Friction, NeoHookean, Solver
from problems import block, ground, make_scene, make_stepper, march, weight
from taylor import hessian_of
from touching_blocks import touching

MU, EPS_V, DT = 0.4, 0.1, 0.02
EPS = EPS_V * DT


def slips_of(term, x):
    """(k, d) slips [m] of the contacts, across their gaps."""
    moved, gaps = term.contacts.gaps_of(term.surface.vertices(x) - term._start), term.contacts.gaps
    along = np.sum(moved * gaps, axis=1) / np.sum(gaps**2, axis=1)
    return moved - along[:, None] * gaps


@pytest.fixture(scope="module", params=product((2, 3), ("plane", "surface")), ids=str)
def lagged(request):
    """Friction between two bodies and on their ground, and a state in which some contacts stick and others slide."""
    space, barrier = touching(*request.param)
    term, x_t = LaggedFriction(barrier, MU, EPS_V), space.from_input(space.mesh.points)
    for part in (barrier, term):
        part.begin_step(Positions(space, x_t), 0.0, DT)
    rng = np.random.default_rng(4)
    x = Positions(space, x_t + EPS * rng.uniform(0.0, 1.5, (len(x_t), 1)) * rng.uniform(-1, 1, x_t.shape))
    sizes = np.linalg.norm(slips_of(term, x), axis=1)
    assert len(sizes) > 4 and np.any(sizes < EPS) and np.any(sizes > EPS)
    return term, x


def law(sizes):
    """Energy, force over slip, and the force's derivative, per unit of sliding force."""
    sticks = sizes < EPS
    energy = np.where(sticks, sizes**2 / EPS - sizes**3 / (3.0 * EPS**2) + EPS / 3.0, sizes)
    over = np.where(sticks, 2.0 / EPS - sizes / EPS**2, 1.0 / np.maximum(sizes, EPS))
    return energy, over, np.where(sticks, 2.0 / EPS - 2.0 * sizes / EPS**2, 0.0)


def at_vertices(term, forces):
    """(n_owned, d) from forces (k, d) on the contacts."""
    found = np.zeros((len(term.surface.objects), forces.shape[1]))
    for i in range(4):
        np.add.at(found, term.contacts.vertices[:, i], term.contacts.coefficients[:, i, None] * forces)
    return term.surface.rows_of(found)


def test_energies_and_forces_are_the_laws(lagged):
    term, x = lagged
    slips = slips_of(term, x)
    energy, over, _ = law(np.linalg.norm(slips, axis=1))
    np.testing.assert_allclose(term.value(x), term.forces @ energy, rtol=1e-12)
    expected = at_vertices(term, term.forces[:, None] * over[:, None] * slips)
    np.testing.assert_allclose(term.gradient(x), expected, atol=1e-12 * np.abs(expected).max())


def test_forces_and_stiffness_where_contacts_are_predicted_to_stick(lagged):
    term, x = lagged
    term.sticks[:] = np.arange(len(term.sticks)) % 3 / EPS
    slips = slips_of(term, x)
    sizes, d = np.linalg.norm(slips, axis=1), slips.shape[1]
    _, over, slope = law(sizes)
    across, along = (np.where(term.sticks > 0.0, term.sticks, own) for own in (over, slope))
    normals = term.contacts.gaps / np.linalg.norm(term.contacts.gaps, axis=1)[:, None]
    n, w = (np.einsum("ki,kj->kij", v, v) for v in (normals, slips / sizes[:, None]))
    plane = across[:, None, None] * (np.eye(d) - n) + (along - across)[:, None, None] * w
    tensors = 3.0 * np.maximum(term.forces, 0.0)[:, None, None] * plane
    rows, size = term.surface.rows, x.owned.size
    expected = np.zeros((size, size))
    for vertices, c, tensor in zip(term.contacts.vertices, term.contacts.coefficients, tensors, strict=True):
        own = [(i, rows[v]) for i, v in enumerate(vertices) if rows[v] >= 0]
        for (i, a), (j, b) in product(own, own):
            expected[d * a : d * a + d, d * b : d * b + d] += c[i] * c[j] * tensor
    found = 3.0 * hessian_of(term, term.space, x.owned).toarray()
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
    changed = np.where(term.sticks > 0.0, term.sticks - over, 0.0)[:, None] * slips
    forces = at_vertices(term, term.forces[:, None] * changed)
    np.testing.assert_allclose(term.predicted_change(x), forces, atol=1e-12 * np.abs(forces).max())
    term.forget_prediction()
    assert np.all(term.predicted_change(x) == 0.0)


def test_what_slides_is_predicted_to_stick_where_it_turns_or_stops(lagged):
    """For ends of any length and direction; with the law's force over slip there, that of small slips after a turn."""
    term, x = lagged
    now, rng, seen = slips_of(term, x), np.random.default_rng(2), set()
    slides = np.linalg.norm(now, axis=1) >= EPS
    for _ in range(100):
        end = Positions(x.space, x.owned + EPS * 10.0 ** rng.uniform(-1, 1) * rng.uniform(-1, 1, x.owned.shape))
        then = slips_of(term, end)
        turned, stopped = np.sum(now * then, axis=1) < 0.0, np.linalg.norm(then, axis=1) < EPS
        found = term.predict(x, end)
        expected = (term.forces > 0.0) & slides & (turned | stopped)
        _, over, _ = law(np.where(turned, 0.0, np.linalg.norm(then, axis=1)))
        np.testing.assert_allclose(term.sticks, np.where(expected, over, 0.0), rtol=1e-12)
        assert found == bool(expected.any())
        seen |= set(zip(slides, turned, stopped, strict=True))
    assert len(seen) == 8


def spun():
    """Newton iterations, backtracks and last positions of a spinning jelly block that falls onto a floor."""
    scene = make_scene(
        (NeoHookean(1e4, 0.4, 1000.0),),
        dt=0.01,
        loads=(weight(3),),
        obstacles=ground(3)[:1],
        contact=(Barrier(dhat=2e-3), Friction(0.3, eps_v=1e-3)),
        solver=Solver(tolerance=1e-4),
    )
    mesh = block((0.0, 0.0, 4e-3), (0.3, 0.3, 0.204), (4, 4, 4))
    velocity = np.array([2.0, 0.0, -1.5]) + np.cross([0.0, -10.0, 0.0], mesh.points - mesh.points.mean(axis=0))
    reports = list(march(make_stepper(scene, mesh), 30, velocity=velocity))
    return sum(r.newton_iterations for r in reports), sum(r.backtracks for r in reports), reports[-1].positions


def test_predictions_spare_backtracks_and_leave_the_minimum_where_it_is(monkeypatch):
    """16 backtracks without them, none with them."""
    fewer, none, y = spun()
    monkeypatch.setattr(LaggedFriction, "predict", lambda *_: False)
    iterations, backtracks, x = spun()
    assert backtracks > 8 and none < 0.25 * backtracks and fewer < iterations
    assert np.abs(x - y).max() < 1e-6
