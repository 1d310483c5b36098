"""The compiled loops of friction beside the same in numpy: the smoothed law, forces and stiffness, predictions."""

from itertools import product

import numpy as np
import pytest
from test_derivatives import DT, EPS_V, MU, near_surfaces
from test_lagged_friction import slips_of

from pdvol.potentials.contact.friction import LaggedFriction
from pdvol.potentials.potential import Positions
from taylor import hessian_of

EPS = EPS_V * DT


@pytest.fixture(scope="module", params=[2, 3])
def lagged(request):
    """Friction between surfaces, its space, and a state in which some contacts stick and others slide."""
    space, barrier = near_surfaces(request.param)
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
    term.sticks[:] = np.arange(len(term.sticks)) % 2
    slips = slips_of(term, x)
    sizes, d = np.linalg.norm(slips, axis=1), slips.shape[1]
    _, over, slope = law(sizes)
    across, along = (np.where(term.sticks, 2.0 / EPS, own) for own in (over, slope))
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
    changed = np.where(term.sticks, 2.0 / EPS - over, 0.0)[:, None] * slips
    forces = at_vertices(term, term.forces[:, None] * changed)
    np.testing.assert_allclose(term.predicted_change(x), forces, atol=1e-12 * np.abs(forces).max())
    term.forget_prediction()
    assert np.all(term.predicted_change(x) == 0.0)


def test_what_slides_is_predicted_to_stick_where_it_turns_or_stops(lagged):
    """For ends of any length and direction."""
    term, x = lagged
    now, rng, seen = slips_of(term, x), np.random.default_rng(2), set()
    slides = np.linalg.norm(now, axis=1) >= EPS
    for _ in range(100):
        end = Positions(x.space, x.owned + EPS * 10.0 ** rng.uniform(-1, 1) * rng.uniform(-1, 1, x.owned.shape))
        then = slips_of(term, end)
        turned, stopped = np.sum(now * then, axis=1) < 0.0, np.linalg.norm(then, axis=1) < EPS
        found = term.predict(x, end)
        expected = (term.forces > 0.0) & slides & (turned | stopped)
        np.testing.assert_array_equal(term.sticks, expected)
        assert found == bool(expected.any())
        seen |= set(zip(slides, turned, stopped, strict=True))
    assert len(seen) == 8
