"""The compiled loops of friction beside the same in numpy: the smoothed law, forces and stiffness, predicted states."""

from itertools import product

import numpy as np
import pytest
from test_derivatives import DT, EPS_V, MU, near_surfaces
from test_lagged_friction import slips_of

from pdvol.potentials.contact.friction import AS_IT_IS, SLIDES, STICKS, LaggedFriction
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


def predict_some(term):
    """A third of the contacts predicted to stick, and a third to slide along arbitrary ways."""
    k, d = term.ways.shape
    rng = np.random.default_rng(1)
    term.ways[:] = rng.standard_normal((k, d))
    term.ways /= np.linalg.norm(term.ways, axis=1)[:, None]
    term.states[:], term.sizes[:] = np.arange(k) % 3, EPS * rng.uniform(0.5, 3.0, k)


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


def test_forces_and_stiffness_of_predicted_states(lagged):
    term, x = lagged
    predict_some(term)
    slips = slips_of(term, x)
    sizes, d = np.linalg.norm(slips, axis=1), slips.shape[1]
    _, over, slope = law(sizes)
    sticks, slides = term.states == STICKS, term.states == SLIDES
    across = np.where(sticks, 2.0 / EPS, np.where(slides, 1.0 / np.maximum(term.sizes, EPS), over))
    along = np.where(sticks, 2.0 / EPS, np.where(slides, 0.0, slope))
    ways = np.where(slides[:, None], term.ways, slips / sizes[:, None])
    normals = term.contacts.gaps / np.linalg.norm(term.contacts.gaps, axis=1)[:, None]
    n, w = (np.einsum("ki,kj->kij", v, v) for v in (normals, ways))
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
    onto = np.sum(slips * term.ways, axis=1)[:, None] * term.ways
    sliding = term.ways + (slips - onto) / np.maximum(term.sizes, EPS)[:, None]
    states = term.states[:, None]
    changed = np.where(states == STICKS, 2.0 / EPS * slips, sliding) - over[:, None] * slips
    forces = at_vertices(term, term.forces[:, None] * np.where(states == AS_IT_IS, 0.0, changed))
    np.testing.assert_allclose(term.predicted_change(x), forces, atol=1e-12 * np.abs(forces).max())
    term.forget_prediction()
    assert np.all(term.predicted_change(x) == 0.0)


def test_states_are_predicted_by_the_table(lagged):
    """Of `friction.py`, for all three states and ends of any length and direction."""
    term, x = lagged
    predict_some(term)
    now, rng = slips_of(term, x), np.random.default_rng(2)
    before, ways, sizes = term.states.copy(), term.ways.copy(), term.sizes.copy()
    seen = set()
    for shift in range(100):
        end = Positions(x.space, x.owned + EPS * 10.0 ** rng.uniform(-1, 1) * rng.uniform(-1, 1, x.owned.shape))
        then, states = slips_of(term, end), (before + shift) % 3
        term.states[:], term.ways[:], term.sizes[:] = states, ways, sizes
        changes = term.predict(x, end)
        for k in np.flatnonzero(term.forces > 0.0):
            size = np.linalg.norm(then[k])
            turned = (ways[k] if states[k] == SLIDES else now[k]) @ then[k] < 0.0
            expected = states[k]
            if states[k] == AS_IT_IS and np.linalg.norm(now[k]) >= EPS and (turned or size < EPS):
                expected = STICKS
            elif states[k] == STICKS and size > EPS:
                expected = SLIDES
                np.testing.assert_allclose(term.ways[k], then[k] / size, rtol=1e-12)
                np.testing.assert_allclose(term.sizes[k], size, rtol=1e-12)
            elif states[k] == SLIDES and (turned or size < 0.5 * EPS):
                expected = STICKS
            assert term.states[k] == expected
            seen.add((int(states[k]), int(expected)))
        np.testing.assert_array_equal(term.states[term.forces <= 0.0], states[term.forces <= 0.0])
        assert changes == bool(np.any(term.states != states))
    stays = {(state, state) for state in (AS_IT_IS, STICKS, SLIDES)}
    assert seen == stays | {(AS_IT_IS, STICKS), (STICKS, SLIDES), (SLIDES, STICKS)}
