"""The compiled loops of friction beside the same in numpy: slips, the smoothed law, forces and stiffness, predicted
states and forces at vertices.
"""

import numpy as np
import pytest
from test_derivatives import DHAT, DT, EPS_V, MU, near_surfaces

from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.potentials.contact.friction import AS_IT_IS, SLIDES, STICKS, Prediction, SurfaceFriction
from pdvol.potentials.potential import Positions

EPS = EPS_V * DT


@pytest.fixture(scope="module", params=[2, 3])
def lagged(request):
    """Friction between surfaces, its space, and a state in which some contacts stick and others slide."""
    space, barrier = near_surfaces(request.param)
    term, x_t = SurfaceFriction(barrier, MU, EPS_V), space.from_input(space.mesh.points)
    for part in (barrier, term):
        part.begin_step(Positions(space, x_t), 0.0, DT)
    rng = np.random.default_rng(4)
    x = Positions(space, x_t + EPS * rng.uniform(0.0, 1.5, (len(x_t), 1)) * rng.uniform(-1, 1, x_t.shape))
    sizes = np.linalg.norm(term.slips(x), axis=1)
    assert len(sizes) > 4 and np.any(sizes < EPS) and np.any(sizes > EPS)
    return term, x


def law(sizes):
    """Energy, force over slip, and the force's derivative, per unit of sliding force."""
    sticks = sizes < EPS
    energy = np.where(sticks, sizes**2 / EPS - sizes**3 / (3.0 * EPS**2) + EPS / 3.0, sizes)
    over = np.where(sticks, 2.0 / EPS - sizes / EPS**2, 1.0 / np.maximum(sizes, EPS))
    return energy, over, np.where(sticks, 2.0 / EPS - 2.0 * sizes / EPS**2, 0.0)


def predicted_states(term, x):
    """A third of the contacts predicted to stick, and a third to slide along arbitrary ways."""
    k, d = term.slips(x).shape
    rng = np.random.default_rng(1)
    ways = rng.standard_normal((k, d))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    return Prediction((np.arange(k) % 3).astype(np.int8), ways, EPS * rng.uniform(0.5, 3.0, k))


def test_slips_are_motions_across_the_normals(lagged):
    term, x = lagged
    moved = term._stencils.gaps_of(term.surface.vertices(x) - term._start)
    along = np.sum(moved * term.normals, axis=1)
    np.testing.assert_allclose(term.slips(x), moved - along[:, None] * term.normals, atol=1e-13 * DHAT)


def test_energies_and_forces_are_the_laws(lagged):
    term, x = lagged
    slips = term.slips(x)
    energy, over, _ = law(np.linalg.norm(slips, axis=1))
    np.testing.assert_allclose(term.value(x), term.forces @ energy, rtol=1e-12)
    forces = term.forces[:, None] * over[:, None] * slips
    scattered = np.zeros((len(term.surface.objects), x.owned.shape[1]))
    for i in range(4):
        np.add.at(scattered, term._stencils.vertices[:, i], term._stencils.coefficients[:, i, None] * forces)
    expected = term.surface.rows_of(scattered)
    np.testing.assert_allclose(term.gradient(x), expected, atol=1e-12 * np.abs(expected).max())


def test_forces_and_stiffness_of_predicted_states(lagged, monkeypatch):
    term, x = lagged
    slips, predicted = term.slips(x), predicted_states(term, x)
    sizes, d = np.linalg.norm(slips, axis=1), slips.shape[1]
    _, over, slope = law(sizes)
    sticks, slides = predicted.states == STICKS, predicted.states == SLIDES
    across = np.where(sticks, 2.0 / EPS, np.where(slides, 1.0 / np.maximum(predicted.sizes, EPS), over))
    along = np.where(sticks, 2.0 / EPS, np.where(slides, 0.0, slope))
    ways = np.where(slides[:, None], predicted.ways, slips / sizes[:, None])
    found = {}
    monkeypatch.setattr(term, "_predicted", predicted)
    monkeypatch.setattr(term, "_add_tensors", lambda tensors, into: found.update(tensors=tensors))
    monkeypatch.setattr(term, "_rows", lambda forces: found.update(forces=forces))
    term.add_hessian(x, 3.0, HessianBlocks(BlockPattern(term.space)))
    term.predicted_change(x)
    n, w = (np.einsum("ki,kj->kij", v, v) for v in (term.normals, ways))
    plane = across[:, None, None] * (np.eye(d) - n) + (along - across)[:, None, None] * w
    tensors = 3.0 * np.maximum(term.forces, 0.0)[:, None, None] * plane
    np.testing.assert_allclose(found["tensors"], tensors, atol=1e-12 * np.abs(tensors).max())
    onto = np.sum(slips * predicted.ways, axis=1)[:, None] * predicted.ways
    sliding = predicted.ways + (slips - onto) / np.maximum(predicted.sizes, EPS)[:, None]
    states = predicted.states[:, None]
    changed = np.where(states == STICKS, 2.0 / EPS * slips, sliding) - over[:, None] * slips
    forces = term.forces[:, None] * np.where(states == AS_IT_IS, 0.0, changed)
    np.testing.assert_allclose(found["forces"], forces, atol=1e-12 * np.abs(forces).max())


def test_states_are_predicted_by_the_table(lagged, monkeypatch):
    """Of `lagged_friction.py`, for all three states and ends of any length and direction."""
    term, x = lagged
    now, before, rng = term.slips(x), predicted_states(term, x), np.random.default_rng(2)
    seen = set()
    for shift in range(100):
        end = Positions(x.space, x.owned + EPS * 10.0 ** rng.uniform(-1, 1) * rng.uniform(-1, 1, x.owned.shape))
        then, states = term.slips(end), (before.states + shift).astype(np.int8) % 3
        copied = Prediction(states.copy(), before.ways.copy(), before.sizes.copy())
        monkeypatch.setattr(term, "_predicted", copied)
        changes = term.predict(x, end)
        for k in np.flatnonzero(term.forces > 0.0):
            size = np.linalg.norm(then[k])
            turned = (before.ways[k] if states[k] == SLIDES else now[k]) @ then[k] < 0.0
            expected = states[k]
            if states[k] == AS_IT_IS and np.linalg.norm(now[k]) >= EPS and (turned or size < EPS):
                expected = STICKS
            elif states[k] == STICKS and size > EPS:
                expected = SLIDES
                np.testing.assert_allclose(copied.ways[k], then[k] / size, rtol=1e-12)
                np.testing.assert_allclose(copied.sizes[k], size, rtol=1e-12)
            elif states[k] == SLIDES and (turned or size < 0.5 * EPS):
                expected = STICKS
            assert copied.states[k] == expected
            seen.add((int(states[k]), int(expected)))
        np.testing.assert_array_equal(copied.states[term.forces <= 0.0], states[term.forces <= 0.0])
        assert changes == bool(np.any(copied.states != states))
    stays = {(state, state) for state in (AS_IT_IS, STICKS, SLIDES)}
    assert seen == stays | {(AS_IT_IS, STICKS), (STICKS, SLIDES), (SLIDES, STICKS)}
