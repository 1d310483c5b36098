"""Every interpolant passes the same tests. Tests of single interpolants follow. The tests of the binding check that one
rank and two agree.
"""

import sys

import igl
import numpy as np
import pytest
from mpi4py import MPI
from test_binding import comb_pair, fold_pair

from pdvol.errors import MeshError
from pdvol.levels.binding import INSIDE, bind
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.interpolants.biharmonic import DROPPED, biharmonic, biharmonic_columns, make_local, squared_laplacian
from pdvol.levels.interpolants.phong import vertex_gradients
from pdvol.levels.prolongation import Prolongation
from pdvol.levels.space import LevelSpace
from pdvol.registry import INTERPOLANTS
from shapes import box, level, together

COMM = MPI.COMM_WORLD


def boxes(d):
    """Two bodies that overlap a little; fine points lie outside of the coarse boxes, coarse ones outside the fine."""
    side = np.eye(d)[0] * 0.98
    coarse = together(box(d, 3, 0.05, 0.9, jitter=0.15), box(d, 3, side - 0.03, side + 1.04, jitter=0.15, seed=1))
    fine = together(box(d, 6, jitter=0.2, seed=2), box(d, 6, side, side + 1.0, jitter=0.2, seed=3))
    return fine, coarse


PAIRS = {"boxes": boxes, "comb": lambda d: comb_pair(d)[:2], "fold": lambda d: fold_pair(d)[:2]}


@pytest.fixture(scope="module", params=[(shape, d) for shape in PAIRS for d in (2, 3)], ids=lambda p: f"{p[0]}-{p[1]}D")
def pair(request):
    shape, d = request.param
    fine, coarse = (LevelSpace(mesh, COMM) for mesh in PAIRS[shape](d))
    return coarse, fine, bind(fine, coarse)


@pytest.fixture(scope="module", params=sorted(INTERPOLANTS))
def prolongation(request, pair):
    coarse, fine, binding = pair
    assert (binding.kind != INSIDE).any(), "no fine vertex is outside"
    return Prolongation(coarse, fine, binding, INTERPOLANTS[request.param])


def vector(space, values):
    vec = space.create_vector()
    vec.array[:] = space.from_input(values).ravel()
    return vec


# ---- all of them


def test_rows_sum_to_one_and_affine_fields_are_reproduced(prolongation):
    weights, coarse, fine = prolongation.weights(), prolongation.coarse.mesh, prolongation.fine.mesh
    # Weights and places are of order one: 1e-12 is round-off with room for badly shaped home cells.
    np.testing.assert_allclose(weights @ np.ones(weights.shape[1]), 1.0, atol=1e-12)
    np.testing.assert_allclose(weights @ coarse.points, fine.points, atol=1e-12)
    rng = np.random.default_rng(0)
    A, b = rng.normal(size=(fine.dim, fine.dim)), rng.normal(size=fine.dim)
    np.testing.assert_allclose(weights @ (coarse.points @ A.T + b), fine.points @ A.T + b, atol=1e-11)


def test_the_matrix_holds_the_weights_and_its_transpose_is_the_adjoint(prolongation, request):
    coarse, fine = prolongation.coarse, prolongation.fine
    rng = np.random.default_rng(0)
    values = rng.normal(size=coarse.mesh.points.shape)
    u, r = vector(coarse, values), vector(fine, rng.normal(size=fine.mesh.points.shape))
    Pu, Ptr = fine.create_vector(), coarse.create_vector()
    prolongation.matrix.mult(u, Pu)
    prolongation.matrix.multTranspose(r, Ptr)
    assert Pu.dot(r) == pytest.approx(u.dot(Ptr), rel=1e-11)
    np.testing.assert_array_equal(fine.to_input(Pu.array.reshape(-1, fine.dim)), prolongation.prolong(values))
    weights = INTERPOLANTS[request.node.callspec.params["prolongation"]](coarse, fine, prolongation.binding)
    np.testing.assert_array_equal(prolongation.weights().toarray(), weights.toarray())
    np.testing.assert_allclose(prolongation.prolong(values), weights @ values, atol=1e-12)


def test_the_weights_are_bounded_and_within_bodies(prolongation):
    """Extrapolation stays bounded. No weight exceeds 6 in these pairs, and the norms agree with the paper's appendix B
    within a factor of two.
    """
    entries, report = prolongation.weights().tocoo(), prolongation.report()
    coarse, fine = prolongation.coarse.mesh, prolongation.fine.mesh
    np.testing.assert_array_equal(coarse.point_bodies[entries.col], fine.point_bodies[entries.row])
    assert report["largest_weight"] == np.abs(entries.data).max() < 6.0
    assert report["frobenius_norm"] == pytest.approx(np.linalg.norm(entries.data), rel=1e-12)
    assert report["frobenius_norm"] < 2.0 * report["sqrt_points"] == 2.0 * np.sqrt(len(fine.points))
    assert report["two_norm"] == pytest.approx(np.linalg.norm(prolongation.weights().toarray(), 2), rel=1e-3)
    assert report["inside"] + report["ray"] + report["neighbour"] + report["orphans"] == len(fine.points)


@pytest.mark.parametrize("name", sorted(INTERPOLANTS))
@pytest.mark.parametrize("d", [2, 3])
def test_the_unit_of_length_does_not_matter(name, d):
    fine, coarse = boxes(d)
    weights = []
    for scale in (1.0, 1e-4):
        spaces = [LevelSpace(level(m.points * scale, m.cells, m.bodies), COMM) for m in (coarse, fine)]
        weights.append(INTERPOLANTS[name](*spaces, bind(spaces[1], spaces[0])).toarray())
    # Dropping is a matter of thresholds: a weight on one of them may fall to either side.
    atol = 2 * DROPPED if name == "biharmonic" else 1e-8
    np.testing.assert_allclose(weights[1], weights[0], atol=atol)


def smooth(X):
    return (X**2).sum(axis=1) + X[:, 0] * X[:, 1]


@pytest.mark.parametrize("d", [2, 3])
def test_the_others_are_better_than_barycentric_inside(d):
    """On a quadratic field, root mean square over fine points inside: less than 60 % of barycentric interpolation's
    error.
    """
    coarse, fine = LevelSpace(box(d, 6, jitter=0.1), COMM), LevelSpace(box(d, 11, 0.01, 0.99, jitter=0.1, seed=1), COMM)
    binding = bind(fine, coarse)
    inside, error = binding.kind == INSIDE, {}
    for name in INTERPOLANTS:
        off = INTERPOLANTS[name](coarse, fine, binding) @ smooth(coarse.mesh.points) - smooth(fine.mesh.points)
        error[name] = np.sqrt(np.mean(off[inside] ** 2))
    assert max(error["biharmonic"], error["phong"]) < 0.6 * error["barycentric"]


# ---- the Laplacian


@pytest.mark.parametrize("d", [2, 3])
def test_the_kernel_is_the_affine_functions(d):
    mesh = box(d, 4, jitter=0.2)
    affine = np.column_stack([np.ones(len(mesh.points)), mesh.points])
    A = squared_laplacian(mesh)
    np.testing.assert_allclose(A @ affine, 0.0, atol=1e-10)
    values = np.linalg.eigvalsh(A.toarray())
    assert values[d] < 1e-10 * values[-1] and values[d + 1] > 1e-5 * values[-1], "d + 1 zeros and no more"
    # What the boundary does to the cotangent Laplacian: it takes the flux of affine functions through the boundary for
    # a Laplacian.
    inner = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary)
    cotangent = igl.cotmatrix(
        mesh.points if d == 3 else np.column_stack([mesh.points, np.zeros(len(mesh.points))]), mesh.cells
    )
    np.testing.assert_allclose(cotangent[inner] @ affine, 0.0, atol=1e-13)
    assert np.abs(cotangent @ affine).max() > 0.01


# ---- biharmonic


def dense(coarse, fine):
    """W before dropping, and B, of one body."""
    back = bind(coarse, LevelSpace(fine, COMM))
    return np.hstack(list(biharmonic_columns(fine, back, coarse.points, "body 0"))), back.matrix(fine)


@pytest.mark.parametrize("d", [2, 3])
def test_constraints_hold_with_control_points_anywhere(d):
    coarse, fine = box(d, 2, -0.06, 1.04, jitter=0.1), box(d, 5, jitter=0.2, seed=1)
    W, B = dense(coarse, fine)
    assert B.data.min() < -0.05, "no coarse vertex is outside the fine mesh"
    np.testing.assert_allclose(B @ W, np.eye(len(coarse.points)), atol=1e-6)
    np.testing.assert_allclose(W @ coarse.points, fine.points, atol=1e-9)
    # A minimum: no change N y that keeps the constraints, B N = 0, lowers the energy to first order (appendix A).
    N = np.linalg.svd(B.toarray())[2][len(coarse.points) :].T
    A = squared_laplacian(fine)
    assert np.abs(N.T @ (A @ W)).max() < 1e-6 * np.median(A.diagonal())


@pytest.mark.parametrize("d", [2, 3])
def test_coincident_control_points_are_the_original_method(d):
    """Every second vertex of a grid as control point: libigl's implementation of Wang et al. 2015 gives the same
    weights.
    """
    fine, coarse = box(d, 4, jitter=0.0), box(d, 2)
    picked = [int(np.flatnonzero((fine.points == p).all(axis=1))[0]) for p in coarse.points]
    rng = np.random.default_rng(0)
    points = fine.points + 0.04 * rng.uniform(-1, 1, fine.points.shape)
    fine, coarse = level(points, fine.cells), level(points[picked], coarse.cells)
    embedded = points if d == 3 else np.column_stack([points, np.zeros(len(points))])
    theirs = igl.biharmonic_coordinates(embedded, fine.cells, [[p] for p in picked], 2)
    np.testing.assert_allclose(dense(coarse, fine)[0], theirs, atol=1e-5)


@pytest.mark.parametrize("d", [2, 3])
def test_more_coarse_vertices_than_fine_ones_are_met_in_the_least_squares_sense(d):
    coarse, fine = box(d, 4, 0.02, 0.98, jitter=0.2), box(d, 2, jitter=0.1)
    W, B = dense(coarse, fine)
    rank = np.linalg.matrix_rank(B.toarray())
    assert rank < B.shape[0]
    # B W is then the projection onto what B can give, and affine fields, which it can, are still reproduced.
    assert np.trace(B @ W) == pytest.approx(rank, abs=1e-4)
    np.testing.assert_allclose(B @ W, B @ np.linalg.pinv(B.toarray()), atol=1e-5)
    np.testing.assert_allclose(W @ coarse.points, fine.points, atol=1e-9)
    spaces = LevelSpace(coarse, COMM), LevelSpace(fine, COMM)
    np.testing.assert_allclose(biharmonic(*spaces, bind(spaces[1], spaces[0])) @ coarse.points, fine.points, atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_a_body_of_one_cell(d):
    corners = np.vstack([np.zeros(d), np.eye(d)])
    fine, coarse = (LevelSpace(level(at, [np.arange(d + 1)]), COMM) for at in (corners, corners * 1.1 - 0.01))
    np.testing.assert_allclose(biharmonic(coarse, fine, bind(fine, coarse)) @ coarse.mesh.points, corners, atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_a_part_without_control_points_is_named(d):
    """One body has two separate boxes, but the coarse mesh has only one of them. The error says that one of two parts
    has no control points.
    """
    two = together(box(d, 2), box(d, 2, 3.0, 4.0))
    fine = LevelSpace(level(two.points, two.cells), COMM)
    coarse = LevelSpace(box(d, 1), COMM)
    with pytest.raises(MeshError, match=rf"body 0: .* need {d + 1} or more .* find 0 in one of its 2 separate parts"):
        biharmonic(coarse, fine, bind(fine, coarse))


def test_a_coordinate_is_local():
    """Four coarse edges away, a coordinate is below 1 % of its peak; the sparse row has lost at most what it may."""
    coarse, fine = box(2, 12), box(2, 26, 0.01, 0.99, jitter=0.2)
    W = dense(coarse, fine)[0]
    middle = int(np.argmin(np.linalg.norm(coarse.points - 0.5, axis=1)))
    far = np.linalg.norm(fine.points - coarse.points[middle], axis=1) > 4 / 12
    assert np.abs(W[far, middle]).max() < 0.01 * W[:, middle].max()
    home = bind(fine, LevelSpace(coarse, COMM)).matrix(coarse)
    sparse = make_local([W[:, :100], W[:, 100:]], home, coarse.points, fine.points)
    assert sparse.nnz < 0.4 * W.size
    # What was dropped, and as much again for the correction.
    assert np.abs(sparse - W).sum(axis=1).max() <= 2 * DROPPED
    assert np.linalg.norm(sparse - W) > 0


def test_weights_that_take_seconds_are_kept(tmp_path, monkeypatch):
    """Stored weights are read again for the same meshes, and other meshes cause a new solve. Small systems are not
    stored.
    """

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    fine, coarse = (LevelSpace(mesh, COMM) for mesh in boxes(2))
    binding = bind(fine, coarse)
    solved = biharmonic(coarse, fine, binding)
    assert not list(tmp_path.rglob("*.npz"))
    module = sys.modules[biharmonic.__module__]  # the package has the function under the module's name
    monkeypatch.setattr(module, "KEPT_FROM", 10)
    first = biharmonic(coarse, fine, binding)
    (file,) = tmp_path.rglob("*.npz")
    with monkeypatch.context() as context:
        context.setattr(module, "squared_laplacian", None)  # must not be called
        again = biharmonic(coarse, fine, binding)
    for weights in (first, again):
        np.testing.assert_array_equal(weights.toarray(), solved.toarray())
    other = LevelSpace(level(coarse.mesh.points * 1.001, coarse.mesh.cells, coarse.mesh.bodies), COMM)
    biharmonic(other, fine, bind(fine, other))
    assert len(list(tmp_path.rglob("*.npz"))) == 2
    file.write_bytes(file.read_bytes()[:-40])  # damaged: solved for again
    np.testing.assert_array_equal(biharmonic(coarse, fine, binding).toarray(), solved.toarray())


# ---- Phong


@pytest.mark.parametrize("d", [2, 3])
def test_phong_is_exact_on_quadratics_where_vertex_gradients_are(d):
    """Around inner vertices of a regular grid cells lie symmetrically: the mean gradient of a quadratic is exact there,
    and so is Phong.
    """
    mesh = box(d, 6)
    inner = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary)
    gradient = np.column_stack([G @ smooth(mesh.points) for G in vertex_gradients(mesh)])
    exact = 2.0 * mesh.points
    exact[:, :2] += mesh.points[:, 1::-1]
    np.testing.assert_allclose(gradient[inner], exact[inner], atol=1e-12)
    coarse, fine = LevelSpace(mesh, COMM), LevelSpace(box(d, 5, 0.2, 0.8, jitter=0.2), COMM)
    found = INTERPOLANTS["phong"](coarse, fine, bind(fine, coarse)) @ smooth(mesh.points)
    np.testing.assert_allclose(found, smooth(fine.mesh.points), atol=1e-12)


# ---- levels in a row, and the coarse ones that linear solvers take


def test_hierarchy_is_a_sequence_with_lazy_prolongations():
    meshes = [box(2, n) for n in (1, 3, 7)]
    hierarchy = Hierarchy(meshes, COMM)
    assert len(hierarchy) == 3 and hierarchy[-1].mesh is meshes[2] and [s.mesh for s in hierarchy] == meshes
    prolongation = hierarchy.prolongation(2)
    assert prolongation is hierarchy.prolongation(2)
    assert prolongation.coarse is hierarchy[1] and prolongation.fine is hierarchy[2]
    for number in (0, 3, -1):
        with pytest.raises(ValueError, match="1 to 2"):
            hierarchy.prolongation(number)


def test_bad_hierarchies():
    with pytest.raises(ValueError, match="at least one level"):
        Hierarchy([], COMM)
    with pytest.raises(ValueError, match="barycentric"):
        Hierarchy([box(2, 1)], COMM, interpolant="?")


@pytest.mark.parametrize("limit, value, columns", [("MAX_COARSE_VERTICES", 63, 8), ("MAX_WEIGHTS", 1, None)])
def test_coarse_levels_that_cost_too_much_are_not_taken(monkeypatch, limit, value, columns):
    """A level of 64 vertices that is too large, and weights of more than one coarse vertex for each fine one."""
    hierarchy = Hierarchy([box(3, n) for n in (1, 3, 10)], COMM)
    assert hierarchy.coarse_weights(2).shape[1] == 64
    monkeypatch.setattr("pdvol.levels.hierarchy." + limit, value)
    weights = hierarchy.coarse_weights(2)
    assert columns == (None if weights is None else weights.shape[1])


def test_the_coarse_level_for_linear_solvers():
    """The largest level that is small enough, through all prolongations between; none below the coarsest."""
    hierarchy = Hierarchy([box(3, n) for n in (1, 3, 10, 11)], COMM)
    assert hierarchy.coarse_weights(0) is None
    assert hierarchy.coarse_weights(1) is None  # 64 vertices, 8 times those of level 0
    for number in (2, 3):  # 1,331 and 1,728 vertices: level 1 has 64, level 2 is not many times smaller
        weights = hierarchy.coarse_weights(number)
        assert weights.shape == (len(hierarchy[number].mesh.points), 64)
        fine = hierarchy[number].mesh.points
        np.testing.assert_allclose(weights @ hierarchy[1].mesh.points, fine, atol=1e-12)
        np.testing.assert_allclose(hierarchy.prolong(hierarchy[1].mesh.points, 1, number), fine, atol=1e-12)
        np.testing.assert_array_equal(hierarchy.prolong(fine, number, number), fine)
