"""Products and solves are the same on any number of ranks, and take hardly more iterations."""

import numpy as np
import pytest
from petsc4py import PETSc

from on_ranks import results_on
from pdvol.levels.space import LevelSpace
from pdvol.scene import Solver
from pdvol.solve.linear.coarse_space import CoarseSpace, grid_weights
from pdvol.solve.linear.solver import LINEAR_METHODS, LinearSolver
from pdvol.solve.linear.system_matrix import SystemMatrix
from shapes import box
from springs import springs


def multiply_and_solve(comm, d):
    space = LevelSpace(box(d, 5, jitter=0.1, seed=1), comm)
    field = np.random.default_rng(3).standard_normal(space.mesh.points.shape)
    system = SystemMatrix(space, space.owned_points % 7 == 0)
    right, solution, results = space.create_vector(), space.create_vector(), {}
    right.setArray(space.from_input(field).ravel())
    whole = lambda vector: space.to_input(vector.getArray().reshape(-1, d))
    for pairs in (True, False):  # couplings between ranks change
        system.assemble(springs(space, mass=0.1, pairs=pairs))
        system.shell.mult(right, solution)
        results[f"product {pairs}"] = whole(solution)
        for method in LINEAR_METHODS:
            made = LinearSolver(
                PETSc.KSP().create(comm),
                Solver(linear=method, linear_rtol=1e-11),
                lambda: [CoarseSpace(space, grid_weights(space.mesh), system.all_supported)],
            )
            made.set_matrix(system)
            made.solve(right, solution)
            assert made.method == method
            results[f"{method} {pairs}"] = whole(solution)
    return results


@pytest.mark.mpi
@pytest.mark.parametrize("d, ranks", [(2, 2), (3, 2), pytest.param(3, 3, marks=pytest.mark.slow)])
def test_one_rank_and_more_agree(d, ranks):
    one, more = results_on((1, ranks), multiply_and_solve, d)
    for pairs in (True, False):
        product, direct = one[f"product {pairs}"], one[f"direct {pairs}"]
        np.testing.assert_allclose(more[f"product {pairs}"], product, rtol=0.0, atol=1e-12 * np.abs(product).max())
        for results in (one, more):
            for method in LINEAR_METHODS:
                found = results[f"{method} {pairs}"]
                np.testing.assert_allclose(found, direct, rtol=0.0, atol=1e-7 * np.abs(direct).max())


def count_iterations(comm, d):
    space = LevelSpace(box(d, 12 if d == 2 else 6, jitter=0.1, seed=1), comm)
    field = np.random.default_rng(3).standard_normal(space.mesh.points.shape)
    system = SystemMatrix(space, np.zeros(space.n_owned, dtype=bool))
    found = {}
    for stiff in (1.0, 1e2):
        system.assemble(springs(space, stiff=stiff))
        system.factor_incompletely()
        found[str(stiff)] = np.array(system.solve(space.from_input(field).ravel().copy(), 1e-6, 500)[1:])
    return found


@pytest.mark.mpi
@pytest.mark.parametrize("d", [2, 3])
def test_couplings_between_ranks_cost_few_iterations(d):
    """A stiff one, as a contact is, too: factors of each rank's own rows alone take 3.5 to 5 times as many."""
    one, two, four = results_on((1, 2, 4), count_iterations, d)
    for stiff in one:
        reason, iterations = one[stiff]
        assert reason > 0 and iterations > 5
        for more in (two, four):
            assert more[stiff][0] == reason and more[stiff][1] < 1.75 * iterations
