"""Linear solvers: the coarse space is a Galerkin one, every method gives the same answer, and failures lead through the
remedies in order.
"""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_array

from pdvol.errors import SimulationError
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.scene import Gravity, NeoHookean, Solver, Support
from pdvol.solve.globalization import Projection
from pdvol.solve.linear.coarse_space import (
    COARSE_DIAGONAL_SHIFT,
    GRID_NODES,
    MIN_NODE_WEIGHT,
    CoarseSpace,
    grid_weights,
)
from pdvol.solve.linear.solver import (
    COARSE_SPACE_GROWTH,
    COARSE_SPACE_MARGIN,
    COARSE_SPACE_VERTICES,
    DIAGONAL_SHIFTS,
    DIRECT_SOLVES,
    MAX_CG_ITERATIONS,
    MAX_ITERATIONS_WITHOUT_COARSE_SPACE,
    LinearSolver,
)
from pdvol.solve.linear.system_matrix import SystemMatrix
from problems import block, make_scene, make_stepper, take_step
from shapes import box, together

COMM = MPI.COMM_SELF
ROUND = 1e-12


def random_blocks(space, seed=0, mass=1.0, pairs=True):
    """A random positive definite sum: springs between the vertices of cells and, like contacts, between others."""
    rng = np.random.default_rng(seed)
    pattern, d = BlockPattern(space), space.dim
    blocks = HessianBlocks(pattern)
    blocks.add_masses(np.full((space.n_owned, d), mass))
    local = pattern.rows != pattern.columns
    ends = [(pattern.rows[local], pattern.columns[local])]
    if pairs:
        ends.append(np.sort(rng.choice(space.n_owned, (10, 2), replace=False)).T)
    for row, column in ends:
        n = rng.standard_normal((len(row), d))
        springs = n[:, :, None] * n[:, None, :]
        blocks.add_diagonal(row, springs)
        blocks.add_diagonal(column, springs)
        blocks.add_pairs(row, column, -springs)
    return blocks


@pytest.fixture(scope="module", params=[2, 3])
def space(request):
    return LevelSpace(box(request.param, 4, jitter=0.1, seed=1), COMM)


def systems(space, supported=None, **options):
    blocks = random_blocks(space, **options)
    dense = blocks.to_csr().toarray()
    system = SystemMatrix(space, np.zeros(space.n_owned, dtype=bool) if supported is None else supported)
    system.assemble(blocks)
    return system, dense


def assert_same(space, system, dense):
    """The system's matrix is the dense one, tried on a random vector."""
    x = space.create_vector()
    x.setArray(np.random.default_rng(2).standard_normal(len(dense)))
    y = x.duplicate()
    system.petsc.mult(x, y)
    np.testing.assert_allclose(
        y.getArray(), dense @ x.getArray(), rtol=0.0, atol=ROUND * np.abs(dense).sum(axis=1).max()
    )


def test_the_matrix_is_what_was_summed(space):
    system, dense = systems(space)
    assert_same(space, system, dense)


def test_supported_rows_are_the_identitys(space):
    supported = np.arange(space.n_owned) % 3 == 0
    system, dense = systems(space, supported)
    rows = np.repeat(supported, space.dim)
    dense[rows] = dense[:, rows] = 0.0
    dense[rows, rows] = 1.0
    assert_same(space, system, dense)


def test_pairs_come_and_go(space):
    """A new pair makes a new matrix. A pair that has disappeared leaves no entry behind."""
    system = SystemMatrix(space, np.zeros(space.n_owned, dtype=bool))
    assert system.assemble(random_blocks(space, pairs=False))
    assert system.assemble(random_blocks(space, pairs=True))
    assert not system.assemble(random_blocks(space, pairs=True))
    blocks = random_blocks(space, pairs=False)
    dense = blocks.to_csr().toarray()
    assert not system.assemble(blocks)
    assert_same(space, system, dense)


@pytest.mark.parametrize("d", [2, 3])
def test_grid_weights_reproduce_affine_fields_body_by_body(d):
    mesh = together(box(d, 5, jitter=0.1), box(d, 4, low=1.5, high=2.5, jitter=0.1))
    weights = grid_weights(mesh)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-13)
    assert weights.min() >= 0.0
    owners = [set(weights[mesh.point_bodies == body].indices) for body in (0, 1)]
    assert not owners[0] & owners[1], "a node serves two bodies"
    # Positions of the nodes that reproduce the points exist: the grid's own, found by least squares.
    nodes, *_ = np.linalg.lstsq(weights.toarray(), mesh.points, rcond=None)
    np.testing.assert_allclose(weights @ nodes, mesh.points, atol=1e-12)


def test_the_coarse_correction_is_galerkins(space):
    """P (P'AP)^-1 P' r against numpy, pairs included, and nothing at supported vertices."""
    supported = np.arange(space.n_owned) % 4 == 0
    blocks = random_blocks(space)
    system = SystemMatrix(space, supported)
    system.assemble(blocks)
    coarse = CoarseSpace(space, grid_weights(space.mesh), system.all_supported)
    coarse.update(system.parts)
    d, n = space.dim, space.n_owned
    A = np.zeros((n * d, n * d))
    x, y = space.create_vector(), space.create_vector()
    for k in range(n * d):
        x.set(0.0)
        x.setValue(k, 1.0)
        x.assemble()
        system.petsc.mult(x, y)
        A[:, k] = y.getArray()
    weights = grid_weights(space.mesh)[space.owned_points].toarray()
    weights[supported] = 0.0
    P = np.kron(weights[:, weights.sum(axis=0) > MIN_NODE_WEIGHT], np.eye(d))
    assert P.shape[1] == coarse.size * d
    G = P.T @ A @ P
    G[np.diag_indices(len(G))] *= 1.0 + COARSE_DIAGONAL_SHIFT
    r, into = np.random.default_rng(3).standard_normal((2, n * d))
    before, expected = into.copy(), P @ np.linalg.solve(G, P.T @ r)
    coarse.add_correction(r, into)
    np.testing.assert_allclose(into - before, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def solver(space, system, **settings):
    ksp = PETSc.KSP().create(COMM)
    made = LinearSolver(
        ksp,
        Solver(**settings),
        len(space.mesh.points),
        lambda: CoarseSpace(space, grid_weights(space.mesh), system.all_supported),
    )
    ksp.setOperators(system.petsc)
    made.set_parts(system.parts)
    return made


@pytest.mark.parametrize("method", ["iterative", "multilevel", "direct"])
def test_all_methods_agree(space, method):
    system, dense = systems(space, mass=0.1)
    made = solver(space, system, linear=method, accuracy=1e-10)
    right = space.create_vector()
    right.setArray(np.random.default_rng(4).standard_normal(len(dense)))
    solution = right.duplicate()
    made.solve(right, solution)
    expected = np.linalg.solve(dense, right.getArray())
    np.testing.assert_allclose(solution.getArray(), expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())
    assert made.method == method


@pytest.mark.parametrize(
    "options", ["-ksp_type cg -pc_type gamg", "-ksp_type preonly -pc_type lu", "-ksp_type gmres -pc_type jacobi"]
)
def test_users_options_reach_petsc(options):
    """One step under a user's own solver is that of the direct one."""
    results = []
    for settings in ({"linear": "direct"}, {"linear": "iterative", "petsc": f"{options} -ksp_rtol 1e-10"}):
        scene = make_scene(
            loads=(Gravity((0.0, 0.0, -9.81)),),
            supports=(Support(lambda X: X[:, 2] < 1e-9),),
            solver=Solver(tolerance=1e-8, **settings),
        )
        problem = make_stepper(scene, box(3, 3))
        X = problem.space.mesh.points
        results.append(take_step(problem, 1, X, np.zeros_like(X)).positions)
    assert np.abs(results[0] - X).max() > 1e-5
    np.testing.assert_allclose(results[1], results[0], atol=1e-9)


def test_auto_begins_with_a_coarse_space_on_large_levels(space):
    system, _ = systems(space)
    coarse = lambda: CoarseSpace(space, grid_weights(space.mesh), system.all_supported)
    for vertices, method in ((COARSE_SPACE_VERTICES - 1, "iterative"), (COARSE_SPACE_VERTICES, "multilevel")):
        assert LinearSolver(PETSc.KSP().create(COMM), Solver(), vertices, coarse).method == method


def test_auto_hands_over_where_iterations_are_many(space):
    system, _ = systems(space)
    made = solver(space, system)
    for iterations, method in (
        (MAX_ITERATIONS_WITHOUT_COARSE_SPACE, "iterative"),
        (MAX_ITERATIONS_WITHOUT_COARSE_SPACE + 1, "multilevel"),
        (MAX_CG_ITERATIONS, "multilevel"),
        (MAX_CG_ITERATIONS + 1, "direct"),
        *((1, "direct") for _ in range(DIRECT_SOLVES - 1)),
        (1, "multilevel"),
    ):
        made.note_iterations(iterations)
        assert made.method == method


def test_the_coarse_operator_is_summed_again_once_iterations_grow(space, monkeypatch):
    updates = []
    monkeypatch.setattr(CoarseSpace, "update", lambda self, parts: updates.append(parts))
    system, _ = systems(space)
    made = solver(space, system, linear="multilevel")
    first = 10
    most = int(COARSE_SPACE_GROWTH * first + COARSE_SPACE_MARGIN)
    for iterations, expected in ((first, 1), (most, 1), (most + 1, 2), (most + 1, 2)):
        made.note_iterations(iterations)
        made.set_parts(system.parts)
        assert len(updates) == expected


def test_conjugate_gradients_that_reach_their_limit_are_a_failure(space, monkeypatch):
    """The direct method takes over within the same solve."""
    monkeypatch.setattr("pdvol.solve.linear.solver.CG_ITERATION_LIMIT", 2)
    system, dense = systems(space, mass=1e-3)
    made = solver(space, system, linear="iterative", accuracy=1e-10)
    right = space.create_vector()
    right.setArray(np.random.default_rng(4).standard_normal(len(dense)))
    solution = right.duplicate()
    made.solve(right, solution)
    assert made.method == "direct"
    residual = dense @ solution.getArray() - right.getArray()
    assert np.linalg.norm(residual) < 1e-9 * np.linalg.norm(right.getArray())


@pytest.mark.parametrize("d, n", [(2, 12), (2, 40), (3, 5), (3, 12)])
def test_a_grid_has_as_many_nodes_as_the_square_root_of_the_vertices_asks_for(d, n):
    mesh = box(d, n)
    nodes = grid_weights(mesh).shape[1]
    most = round(GRID_NODES * len(mesh.points) ** 0.5) + 2**d
    assert most / 4 <= nodes <= most


def test_a_coarse_node_with_hardly_any_weight_is_left_out(space):
    """Its row of P'AP would be nearly zero."""
    supported = np.zeros(space.n_owned, dtype=bool)
    weights = grid_weights(space.mesh).toarray()
    faint = np.zeros((len(weights), 1))
    faint[3] = 0.5 * MIN_NODE_WEIGHT
    size = CoarseSpace(space, csr_array(weights), supported).size
    assert CoarseSpace(space, csr_array(np.hstack([weights, faint])), supported).size == size
    assert CoarseSpace(space, csr_array(np.hstack([weights, 4 * faint])), supported).size == size + 1


def test_dependent_coarse_nodes_do_no_harm(space):
    """Two nodes with the same weights make P'AP exactly singular; the shift of its diagonal keeps it definite."""
    blocks = HessianBlocks(BlockPattern(space))
    blocks.add_masses(np.ones((space.n_owned, space.dim)))
    system = SystemMatrix(space, np.zeros(space.n_owned, dtype=bool))
    system.assemble(blocks)
    halves = np.arange(space.n_owned)[:, None] % 2 == np.arange(2)
    residual = np.random.default_rng(3).standard_normal(space.n_owned * space.dim)
    corrections = []
    for P in (halves, np.hstack([halves, halves])):
        coarse = CoarseSpace(space, csr_array(P.astype(float)), system.all_supported)
        coarse.update(system.parts)
        corrections.append(np.zeros(len(residual)))
        coarse.add_correction(residual, corrections[-1])
    scale = np.abs(corrections[0]).max()
    np.testing.assert_allclose(corrections[1], corrections[0], rtol=0.0, atol=1e-5 * scale)


@pytest.mark.parametrize("linear", ["auto", "iterative", "multilevel", "direct"])
def test_a_remembered_method_is_used_only_with_the_same_setting(space, linear):
    """A solver that has switched to the direct method continues with it after a resume. If the setting has changed, the
    setting decides.
    """
    system, _ = systems(space)
    learned = solver(space, system, linear=linear)
    learned.use_direct()
    for other in ("auto", "iterative", "multilevel", "direct"):
        resumed = solver(space, system, linear=other)
        before = resumed.method
        resumed.restore(learned.memory)
        assert resumed.method == ("direct" if other == linear else before)
        assert resumed.memory == learned.memory or other != linear


@pytest.mark.parametrize("wrong", [{"method": 3}, {"easy": [1]}, {"shift": -1}, {"workspace": "2"}, {"linear": None}])
def test_a_memory_that_no_solver_wrote_is_ignored(space, wrong):
    system, _ = systems(space)
    learned, resumed = solver(space, system), solver(space, system)
    learned.use_direct()
    resumed.restore({**learned.memory, **wrong})
    assert resumed.method == "iterative"


def test_failures_take_every_remedy_once(space):
    """No linear solve converges. Every remedy is tried once, then the error names the linear solve."""
    system, dense = systems(space)
    made = solver(space, system)
    tried = []

    class Failing:
        """A KSP whose solves all fail."""

        def __init__(self, ksp):
            self.ksp = ksp

        def __getattr__(self, name):
            return getattr(self.ksp, name)

        def solve(self, *_):
            tried.append(made.method)

        def getConvergedReason(self):
            return int(PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC)

    made.ksp = Failing(made.ksp)
    with pytest.raises(SimulationError, match="linear solve failed"):
        made.solve(None, None)
    assert tried == ["iterative"] * len(DIAGONAL_SHIFTS) + ["direct"] * 3


def test_an_indefinite_factor_is_strengthened():
    """Stiff pairs between all vertices of two faces break the incomplete factor; strengthened, it solves."""
    space = LevelSpace(together(box(3, 3), box(3, 3, low=1.01, high=2.01)), COMM)
    blocks = random_blocks(space, pairs=False, mass=1e-3)
    rng = np.random.default_rng(0)
    for _ in range(30):
        a, b, c, e = np.sort(rng.choice(space.n_owned, 4, replace=False))
        coefficients = np.array([0.6, 0.4, -0.5, -0.5])
        n = rng.standard_normal(3)
        middle = 1e5 * np.outer(n, n)
        for i, p in enumerate((a, b, c, e)):
            for j, q in enumerate((a, b, c, e)):
                blocks.add_pairs(np.array([p]), np.array([q]), coefficients[i] * coefficients[j] * middle[None])
    dense = blocks.to_csr().toarray()
    system = SystemMatrix(space, np.zeros(space.n_owned, dtype=bool))
    system.assemble(blocks)
    made = solver(space, system, linear="iterative", accuracy=1e-8)
    right = space.create_vector()
    right.setArray(rng.standard_normal(len(dense)))
    solution = right.duplicate()
    made.solve(right, solution)
    assert made.memory["shift"] > 0 and made.method == "iterative"
    residual = right.getArray() - dense @ solution.getArray()
    assert np.linalg.norm(residual) < 1e-4 * np.linalg.norm(right.getArray())


@pytest.mark.parametrize("method", ["iterative", "direct"])
def test_a_direct_solve_reports_an_indefinite_matrix(space, method):
    """One vertex has a negative mass. The factor then has negative pivots, and otherwise it has none."""
    for mass in (1.0, -100.0):
        blocks = random_blocks(space)
        masses = np.zeros((space.n_owned, space.dim))
        masses[3] = mass
        blocks.add_masses(masses)
        system = SystemMatrix(space, np.zeros(space.n_owned, dtype=bool))
        system.assemble(blocks)
        made = solver(space, system, linear="direct")
        right = space.create_vector()
        right.set(1.0)
        made.solve(right, right.duplicate())
        assert made.detects_indefinite and made.found_indefinite == (mass < 0)
        assert not solver(space, system, linear="iterative").found_indefinite


def test_an_option_that_hides_the_pivots_is_respected(space):
    system, _ = systems(space)
    assert not solver(space, system, linear="direct", petsc="-pc_type lu").detects_indefinite


@pytest.mark.parametrize("indefinite", [False, True])
def test_newton_tries_the_true_hessian_under_a_direct_solver(monkeypatch, indefinite):
    """A thin strip is released from a compressed and uneven state. The solver reports an indefinite matrix or does not;
    the step ends in the same state as with the iterative solver in both cases.
    """
    ends, tried = [], []
    solve, after = LinearSolver.solve, Projection.after  # Newton itself solves by SNES, but for a second try

    def projected(self, *arguments):
        found = after(self, *arguments)
        tried.append(found.mode)
        return found

    monkeypatch.setattr(LinearSolver, "solve", lambda self, *vectors: tried.append("again") or solve(self, *vectors))
    monkeypatch.setattr(Projection, "after", projected)
    if indefinite:
        monkeypatch.setattr(LinearSolver, "found_indefinite", property(lambda self: self.method == "direct"))
    mesh = block((0.0, 0.0), (1.0, 0.05), (20, 1))
    wild = mesh.points * [0.6, 1.0] + 0.002 * np.random.default_rng(5).uniform(-1.0, 1.0, mesh.points.shape)
    for method in ("iterative", "direct"):
        tried.clear()
        scene = make_scene(
            materials=(NeoHookean(1e6),), solver=Solver(tolerance=1e-8, linear=method, accuracy=1e-10), dt=0.1
        )
        ends.append(take_step(make_stepper(scene, mesh), 1, wild, np.zeros_like(wild)).positions)
    assert "none" in tried and ("again" in tried) == indefinite
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-7)
