"""Muscles: an equilibrium worked out by hand, cells carried through levels."""

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.materials import level_muscles
from pdvol.scene import Muscle, NeoHookean, Solver, Support
from problems import SOFT, block, make_scene, make_stepper, take_step
from shapes import box

DIMENSIONS = [2, 3]
STRENGTH = 3e4


def muscle(**settings):
    given = {"fibre": (1.0, 0.0), "strength": STRENGTH} | settings
    return Muscle("body 0", **given)


def turning(X):
    """A fibre field of no constant length."""
    return 2.0 * np.column_stack([np.cos(X[:, 0]), np.sin(X[:, 0]), *([0.3 + 0.0 * X[:, 0]] * (X.shape[1] - 2))])


@pytest.mark.parametrize("d", DIMENSIONS)
def test_the_length_of_a_bar_that_contracts(d):
    """Without Poisson's effect P = mu (F - 1/F) + T F = 0 along the fibre: F = sqrt(mu / (mu + T))."""
    material = NeoHookean(1e5, 0.0, 1000.0)
    fibre = np.eye(d)[0]
    seconds = 100.0
    scene = make_scene(
        (material,),
        dt=seconds,
        supports=(Support(lambda X: (X < 1e-9).all(axis=1)),),
        muscles=(muscle(fibre=tuple(3.0 * fibre), activation=0.5),),
        solver=Solver(tolerance=1e-6 / seconds, linear="direct"),
    )
    mesh = block((0.0,) * d, (1.0,) + (0.2,) * (d - 1), (4,) + (1,) * (d - 1))
    stepper = make_stepper(scene, mesh)
    x = mesh.points
    for number in (1, 2):
        x = take_step(stepper, number, x, 0.0 * x).positions
    sizes = np.linalg.norm(x[:, None] - x[None], axis=2).max(), np.linalg.norm(mesh.points.max(axis=0))
    F = np.sqrt(material.mu / (material.mu + 0.5 * STRENGTH))
    assert sizes[0] == pytest.approx(np.hypot(F, 0.2 * np.sqrt(d - 1)), rel=1e-5)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_finer_levels_take_cells_places_and_fibres_of_the_coarsest(d):
    coarse, fine = box(d, 2, jitter=0.1, seed=1), box(d, 4, jitter=0.1, seed=2)
    hierarchy = Hierarchy([coarse, fine], MPI.COMM_SELF)
    scene = make_scene((SOFT,), muscles=(muscle(fibre=turning, where=lambda X: X[:, 0] > 0.5),))
    (above,), (found,) = (level_muscles(scene, hierarchy, level) for level in range(2))
    origins = hierarchy.origins(1)
    assert np.array_equal(found.cells, np.flatnonzero(np.isin(origins, above.cells)))
    assert 0 < len(found.cells) < len(fine.cells)
    centres = coarse.points[coarse.cells].mean(axis=1)
    np.testing.assert_array_equal(found.places, centres[origins[found.cells]])
    np.testing.assert_allclose(found.fibres, Muscle("b", turning, 1.0).fibres(found.places), rtol=1e-15)
