"""The compiled parts of the linear solver against dense algebra, in 2D and 3D, and on ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_array

from on_ranks import results_on
from pdvol.compiled import ffi, pointer
from pdvol.levels.space import LevelSpace
from pdvol.native import library
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.scene import Solver
from pdvol.solve.linear.coarse_space import COARSE_DIAGONAL_SHIFT, COARSE_VERTICES, CoarseSpace, grid_weights
from pdvol.solve.linear.solver import LINEAR_METHODS, LinearSolver
from pdvol.solve.linear.system_matrix import SystemMatrix
from shapes import box, grid, together
from springs import dense, springs
from taylor import whole_matrix

COMM = MPI.COMM_SELF
ROUND = 1e-12  # of sums in double precision
SINGLE = 1e-5  # of the factor, in single precision
CONVERGED, TOO_MANY, INDEFINITE = 2, -3, -10  # PETSc's numbers


@pytest.fixture(scope="module", params=[2, 3])
def space(request):
    return LevelSpace(box(request.param, 4, jitter=0.1, seed=1), COMM)


def assembled(space, blocks, supported=None):
    system = SystemMatrix(space, np.zeros(space.n_owned, dtype=bool) if supported is None else supported)
    system.assemble(blocks)
    return system


def factored(system, drop=0.0):
    """The incomplete factor, named to the system, and the number of tries."""
    tries = system.factor_incompletely(drop)
    count = system.compiled.factor_starts[system.compiled.count]
    numbers = ffi.buffer(system.compiled.factor, 4 * count * system.space.dim**2)
    return np.frombuffer(numbers, dtype=np.float32), tries


def applied(system, residual):
    """(R' R)^-1 residual."""
    z = np.zeros((len(residual), 4), dtype=np.float32)
    z[:, : residual.shape[1]] = residual
    library[residual.shape[1]].precondition_locally(system.compiled, pointer(z, "float"))
    assert not z[:, residual.shape[1] :].any(), "numbers behind a vertex's own are not zero"
    return z[:, : residual.shape[1]].astype(float)


# ---- the sum and its products


@pytest.mark.parametrize("pairs", [False, True])
@pytest.mark.parametrize("held", [0, 3])
def test_the_product_is_the_dense_one(space, pairs, held):
    """On PETSc's shell, and by PETSc's own matrix; supported rows are the identity's."""
    supported = np.arange(space.n_owned) % held == 0 if held else np.zeros(space.n_owned, dtype=bool)
    blocks = springs(space, pairs=pairs)
    expected = dense(space, blocks, supported)
    system = assembled(space, blocks, supported)
    x = space.create_vector()
    x.setArray(np.random.default_rng(2).standard_normal(len(expected)))
    for matrix in (system.shell, system.petsc):
        y = x.duplicate()
        matrix.mult(x, y)
        np.testing.assert_allclose(
            y.getArray(), expected @ x.getArray(), rtol=0.0, atol=ROUND * np.abs(expected).sum(axis=1).max()
        )


def test_the_sum_is_the_one_of_all_contributions(space):
    """Blocks of a row ascend from its diagonal, each place once, and repeat to the last bit."""
    starts, columns, blocks = springs(space).merged()
    np.testing.assert_array_equal(blocks, springs(space).merged()[2])
    for row in range(space.n_owned):
        mine = columns[starts[row] : starts[row + 1]]
        assert mine[0] == row and (np.diff(mine) > 0).all()
    added = HessianBlocks(BlockPattern(space))
    one, other = np.array([5, 0, 5, 5]), np.array([7, 9, 7, 5])
    values = np.random.default_rng(0).standard_normal((4, space.dim, space.dim))
    values[3] += values[3].T
    added.add_pairs(one, other, values)
    expected = np.zeros((space.n_owned, space.dim, space.n_owned, space.dim))
    for i, j, value in zip(one, other, values, strict=True):
        expected[i, :, j] += value
        if i != j:
            expected[j, :, i] += value.T
    np.testing.assert_allclose(whole_matrix(added).toarray(), expected.reshape(2 * (len(expected) * space.dim,)))


@pytest.mark.parametrize("general", [False, True])
def test_petscs_matrix_follows_pairs_that_come_and_go(space, general):
    """An unchanged pattern keeps a blocked matrix, and a pair that has disappeared leaves nothing behind."""
    system = SystemMatrix(space, np.zeros(space.n_owned, dtype=bool), general)
    x = space.create_vector()
    x.setArray(np.random.default_rng(2).standard_normal(space.n_owned * space.dim))
    y, objects = x.duplicate(), []
    for pairs, seed in ((False, 0), (True, 0), (True, 0), (False, 1), (False, 2)):
        blocks = springs(space, seed, pairs=pairs)
        system.assemble(blocks)
        assert system.petsc is system.petsc
        objects.append(system.petsc.handle)
        system.petsc.mult(x, y)
        np.testing.assert_allclose(y.getArray(), dense(space, blocks) @ x.getArray(), atol=1e-10)
    assert general or objects[0] != objects[1] == objects[2] != objects[3] == objects[4]


# ---- the incomplete factor


def reference(matrix, d, pattern):
    """(R' R) of the incomplete factorization by blocks without fill, in dense arithmetic and double precision."""
    n = len(matrix) // d
    part = lambda i: slice(i * d, i * d + d)
    R = np.triu(matrix).astype(float)
    for i in range(n):
        R[part(i), part(i)] = matrix[part(i), part(i)]
    for i in range(n):
        for m in range(i):
            for j in range(i, n):
                if pattern[m, i] and pattern[m, j] and pattern[i, j]:
                    R[part(i), part(j)] -= R[part(m), part(i)].T @ R[part(m), part(j)]
        root = np.linalg.cholesky(R[part(i), part(i)]).T
        R[part(i), part(i)] = root
        for j in range(i + 1, n):
            R[part(i), part(j)] = np.linalg.solve(root.T, R[part(i), part(j)])
    return R.T @ R


@pytest.mark.parametrize("weak", [0.0, 0.5], ids=["all", "strong half"])
def test_the_factor_is_the_incomplete_one(space, weak):
    """Of all blocks, and without those that are weak beside the diagonal."""
    blocks = springs(space, mass=5.0)
    matrix, d = dense(space, blocks), space.dim
    system = assembled(space, blocks)
    starts, columns, values = system.own
    rows, sizes = np.repeat(np.arange(space.n_owned), np.diff(starts)), np.linalg.norm(values, axis=(1, 2))
    relative = sizes / np.sqrt(sizes[starts[:-1]][rows] * sizes[starts[:-1]][columns])
    drop = float(np.quantile(relative[rows != columns], weak)) if weak else 0.0
    kept = relative >= drop
    pattern = np.zeros((space.n_owned, space.n_owned), dtype=bool)
    pattern[rows[kept], columns[kept]] = True
    whole = pattern | pattern.T
    matrix = np.where(np.kron(whole, np.ones((d, d), dtype=bool)), matrix, 0.0)
    assert (kept.mean() < 0.8) == bool(weak)
    factor, tries = factored(system, drop)
    assert tries == 1 and factor.size == kept.sum() * d * d
    r = np.random.default_rng(1).standard_normal((space.n_owned, d))
    expected = np.linalg.solve(reference(matrix, d, pattern), r.ravel()).reshape(r.shape)
    np.testing.assert_allclose(applied(system, r), expected, rtol=0.0, atol=SINGLE * np.abs(expected).max())


def stiff_faces(space):
    """Stiff springs between many sets of four vertices, as contacts of two faces couple them."""
    blocks, rng = springs(space, pairs=False, mass=1e-3), np.random.default_rng(0)
    shares = np.outer([0.6, 0.4, -0.5, -0.5], [0.6, 0.4, -0.5, -0.5])
    for _ in range(30):
        ends = np.sort(rng.choice(space.n_owned, 4, replace=False))
        n = rng.standard_normal(3)
        for i in range(4):
            for j in range(i, 4):
                blocks.add_pairs(ends[i : i + 1], ends[j : j + 1], 1e5 * shares[i, j] * np.outer(n, n)[None])
    return blocks


def test_a_factor_that_breaks_down_is_shifted():
    """The incomplete factor of a positive definite matrix need not be definite; the second is, and solves."""
    space = LevelSpace(together(box(3, 3), box(3, 3, low=1.01, high=2.01)), COMM)
    blocks = stiff_faces(space)
    matrix = dense(space, blocks)
    assert np.linalg.eigvalsh(matrix)[0] > 0.0
    system = assembled(space, blocks)
    factor, tries = factored(system)
    assert tries > 1 and np.isfinite(factor).all()
    right = np.random.default_rng(1).standard_normal(len(matrix))
    found, reason, iterations = system.solve(right, 1e-6, 2000)
    assert reason == CONVERGED
    error = found - np.linalg.solve(matrix, right)
    assert error @ matrix @ error < 1e-6 * right @ np.linalg.solve(matrix, right)


def test_an_indefinite_diagonal_block_has_no_factor(space):
    blocks = springs(space)
    blocks.add_masses(np.where(np.arange(space.n_owned)[:, None] == 3, -1e4, 0.0) * np.ones(space.dim))
    assert factored(assembled(space, blocks))[1] == -1


# ---- conjugate gradients


@pytest.mark.parametrize("coarse", [False, True])
def test_conjugate_gradients_solve(space, coarse):
    supported = np.arange(space.n_owned) % 5 == 0
    blocks = springs(space, mass=0.1)
    matrix = dense(space, blocks, supported)
    system = assembled(space, blocks, supported)
    factor, _ = factored(system)
    right = np.random.default_rng(4).standard_normal(len(matrix))
    if coarse:
        correction = CoarseSpace(space, grid_weights(space.mesh), system.all_supported)
        assert correction.update(system.rows)
        correction.give(system.compiled)
    found, reason, iterations = system.solve(right, 1e-10, 200)
    expected = np.linalg.solve(matrix, right)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())
    assert reason == CONVERGED and 0 < iterations < len(matrix)
    again, *_ = system.solve(right, 1e-10, 200)
    np.testing.assert_array_equal(again, found)
    for unit in (2.0**-180, 2.0**180):  # beyond single precision, in which the preconditioner works
        np.testing.assert_array_equal(system.solve(unit * right, 1e-10, 200)[0], unit * found)
    assert system.solve(right, 1e-10, 2)[1:] == (TOO_MANY, 2)
    assert system.solve(0.0 * right, 1e-10, 2)[1:] == (CONVERGED, 0)
    assert system.solve(right, 1e-8, 2, found)[1:] == (CONVERGED, 0)
    near = found + 1e-4 * np.abs(found).max() * np.random.default_rng(5).standard_normal(len(right))
    begun_near, reason, fewer = system.solve(right, 1e-10, 200, near)
    np.testing.assert_allclose(begun_near, expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())
    assert reason == CONVERGED and 0 < fewer < iterations


def test_conjugate_gradients_notice_an_indefinite_matrix(space):
    """One vertex is pulled away from a neighbour; all diagonal blocks stay positive definite."""
    blocks = springs(space, pairs=False, mass=10.0)
    blocks.add_pairs(np.array([0]), np.array([space.n_owned - 1]), 100.0 * np.eye(space.dim)[None])
    matrix = dense(space, blocks)
    assert np.linalg.eigvalsh(matrix)[0] < 0.0
    system = assembled(space, blocks)
    factor, tries = factored(system)
    right = np.random.default_rng(4).standard_normal(len(matrix))
    assert tries > 0 and system.solve(right, 1e-10, 500)[1] == INDEFINITE


# ---- the coarse space


def corrected(system, coarse, residual):
    """(n, 4) the coarse correction of a residual (n, 4)."""
    d, z = system.space.dim, np.zeros(residual.shape, dtype=np.float32)
    room = np.zeros(coarse.size * d + system.compiled.width)
    library[d].add_coarse_correction(system.compiled, pointer(residual), pointer(room), pointer(z, "float"))
    return z


def test_the_coarse_correction_is_galerkins(space):
    """P (P'AP)^-1 P' r against numpy, pairs included, and nothing at supported vertices."""
    supported = np.arange(space.n_owned) % 4 == 0
    blocks = springs(space)
    matrix, d = dense(space, blocks, supported), space.dim
    system = assembled(space, blocks, supported)
    coarse = CoarseSpace(space, grid_weights(space.mesh), system.all_supported)
    assert coarse.update(system.rows)
    coarse.give(system.compiled)
    weights = grid_weights(space.mesh)[space.owned_points].toarray()
    weights[supported] = 0.0
    P = np.kron(weights[:, weights.any(axis=0)], np.eye(d))
    assert P.shape[1] == coarse.size * d
    G = P.T @ matrix @ P
    G[np.diag_indices(len(G))] *= 1.0 + COARSE_DIAGONAL_SHIFT
    r = np.zeros((space.n_owned, 4))
    r[:, :d] = np.random.default_rng(3).standard_normal((space.n_owned, d))
    z = corrected(system, coarse, r)
    expected = P @ np.linalg.solve(G, P.T @ r[:, :d].ravel())
    np.testing.assert_allclose(z[:, :d].ravel(), expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())


def test_dependent_coarse_nodes_do_no_harm(space):
    """Two nodes with the same weights make P'AP exactly singular; the shift of its diagonal keeps it definite."""
    blocks = HessianBlocks(BlockPattern(space))
    blocks.add_masses(np.ones((space.n_owned, space.dim)))
    system = assembled(space, blocks)
    halves = np.arange(space.n_owned)[:, None] % 2 == np.arange(2)
    for P in (halves, np.hstack([halves, halves])):
        coarse = CoarseSpace(space, csr_array(P.astype(float)), system.all_supported)
        assert coarse.update(system.rows)
        coarse.give(system.compiled)
        z = corrected(system, coarse, np.ones((space.n_owned, 4)))
        assert np.isfinite(z).all() and 0.0 < np.abs(z).max() < 1e3


def test_a_coarse_operator_of_an_indefinite_matrix_is_noticed(space):
    blocks = HessianBlocks(BlockPattern(space))
    blocks.add_masses(-np.ones((space.n_owned, space.dim)))
    system = assembled(space, blocks)
    assert not CoarseSpace(space, grid_weights(space.mesh), system.all_supported).update(system.rows)


@pytest.mark.parametrize("d", [2, 3])
def test_grid_weights_reproduce_affine_fields_body_by_body(d):
    mesh = together(box(d, 9, jitter=0.1), box(d, 7, low=1.5, high=2.5, jitter=0.1))
    weights = grid_weights(mesh)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-13)
    owners = [set(weights[mesh.point_bodies == body].indices) for body in (0, 1)]
    assert not owners[0] & owners[1], "a node serves two bodies"
    # Positions of the nodes that reproduce the points exist: the grid's own, found by least squares.
    nodes, *_ = np.linalg.lstsq(weights.toarray(), mesh.points, rcond=None)
    np.testing.assert_allclose(weights @ nodes, mesh.points, atol=1e-12)


def test_a_grid_has_about_as_many_nodes_as_the_vertices_ask_for():
    """However many bodies there are; a body that fills little of its box, as a ring of cells does, gets a finer one."""
    wanted = lambda mesh: COARSE_VERTICES * len(mesh.points) ** 0.5
    for d, n in ((2, 12), (2, 40), (3, 5), (3, 12)):
        mesh = box(d, n)
        assert wanted(mesh) / 3 <= grid_weights(mesh).shape[1] <= wanted(mesh)
    for bodies in (2, 9, 40):
        mesh = together(*(box(3, 2, low=2.0 * k, high=2.0 * k + 1.0) for k in range(bodies)))
        assert grid_weights(mesh).shape[1] <= max(wanted(mesh), bodies)
    ring = grid(*[np.linspace(0.0, 1.0, 41)] * 2, keep=lambda i, j: not (2 <= i < 38 and 2 <= j < 38))
    assert grid_weights(ring).shape[1] >= 0.6 * wanted(ring)


# ---- on ranks


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
def test_products_and_solves_on_one_rank_and_more_agree(d, ranks):
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
    one, two, three = results_on((1, 2, 3), count_iterations, d)
    for stiff in one:
        reason, iterations = one[stiff]
        assert reason > 0 and iterations > 5
        for more in (two, three):
            assert more[stiff][0] == reason and more[stiff][1] < 1.75 * iterations
