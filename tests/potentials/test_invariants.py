"""Elastic energies do not change under rigid motions, inverted cells are refused, and the largest step keeps cells from
inverting.
"""

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.levels.space import LevelSpace
from pdvol.potentials.potential import LEAST_LEFT, Positions
from pdvol.registry import ELEMENTS
from pdvol.scene import FixedCorotational, NeoHookean, StVenantKirchhoff, rotation_matrix
from problems import elastic
from shapes import box, level

COMM = MPI.COMM_SELF
ROUND = 1e-12  # relative size of sums that cancel
ROOT = 1e-12  # of a step whose cubic's root is known; the solver bisects to the last bit


def setup(mesh, elements="linear", law=NeoHookean):
    space = LevelSpace(mesh, COMM)
    term = elastic(space, law(3.0, 0.3), elements=elements)[0]
    X = space.from_input(mesh.points)
    return space, term, X, X + 0.05 * np.random.default_rng(0).uniform(-1, 1, X.shape)


@pytest.mark.parametrize("elements", ELEMENTS)
@pytest.mark.parametrize("law", [NeoHookean, StVenantKirchhoff, FixedCorotational])
@pytest.mark.parametrize("d", [2, 3])
def test_rigid_motions_cost_nothing(d, law, elements):
    """And turn forces with the body; a mirrored one has no finite energy."""
    space, term, X, x = setup(box(d, 2, jitter=0.1), elements, law)
    turn, shift = rotation_matrix(1.1, (1.0, 2.0, -0.5), d), np.linspace(-3.0, 4.0, d)
    energy = term.value(Positions(space, x))
    assert energy > 1e-3
    assert abs(term.value(Positions(space, X @ turn.T + shift))) < ROUND
    np.testing.assert_allclose(term.value(Positions(space, x @ turn.T + shift)), energy, rtol=1e-11)
    g = term.gradient(Positions(space, x))
    np.testing.assert_allclose(
        term.gradient(Positions(space, x @ turn.T + shift)), g @ turn.T, atol=1e-11 * np.abs(g).max()
    )
    assert term.value(Positions(space, X * np.r_[-1.0, np.ones(d - 1)])) == np.inf


@pytest.mark.parametrize("d", [2, 3])
def test_no_inversion_after_max_step(d):
    mesh = box(d, 3, jitter=0.1)
    space, term, _, x = setup(mesh)
    before = simplex_volumes(space.to_input(x), mesh.cells)
    rng = np.random.default_rng(1)
    capped = 0
    for size in (0.01, 0.1, 1.0, 30.0):
        for _ in range(5):
            p = size * rng.uniform(-1, 1, x.shape)
            step = term.max_step(Positions(space, x), p)
            assert 0.0 < step <= 1.0
            shares = simplex_volumes(space.to_input(x + step * p), mesh.cells) / before
            assert shares.min() >= LEAST_LEFT * (1.0 - 1e-9)
            if step < 1.0:  # and no shorter than needed
                capped += 1
                np.testing.assert_allclose(shares.min(), LEAST_LEFT, rtol=1e-6)
    assert capped >= 10


@pytest.mark.parametrize("d", [2, 3])
def test_max_step_of_one_cell(d):
    """The unit simplex: roots of its volume along straight paths are known."""
    corners = np.concatenate([np.zeros((1, d)), np.eye(d)])
    space, term, X, _ = setup(level(corners, [range(d + 1)]))
    x, apex = Positions(space, X), np.all(X == np.eye(d)[-1], axis=1)

    # The last corner sinks by 2: volume share 1 - 2 t, down to 0.1 at t = 0.45.
    sink = -2.0 * np.outer(apex, np.eye(d)[-1])
    np.testing.assert_allclose(term.max_step(x, sink), 0.5 * (1.0 - LEAST_LEFT), rtol=ROOT)
    # All edges shrink by the factor 1 - t: share (1 - t)^d.
    np.testing.assert_allclose(term.max_step(x, -X), 1.0 - LEAST_LEFT ** (1.0 / d), rtol=ROOT)
    # Growing, moving as a whole, and shrinking by less than the cap are free.
    for free in (X, np.ones_like(X), 0.45 * sink):
        assert term.max_step(x, free * (1.0 - 1e-9)) == 1.0
    # Edge 1 shrinks by 1 - 4 t and back again if edge 2 did the same: share (1 - 4 t)^2 in their plane is positive at t
    # = 1, yet it passes 0.1 at t = (1 - sqrt(0.1)) / 4. The step must find the first root, not look at the end.
    through = -4.0 * X * np.r_[1.0, 1.0, np.zeros(d - 2)]
    np.testing.assert_allclose(term.max_step(x, through), (1.0 - np.sqrt(LEAST_LEFT)) / 4.0, rtol=ROOT)
