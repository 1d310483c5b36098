"""Prolongation: the PETSc matrix and what the report says; exactness and adjoint are tested with the interpolants."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from pdvol.levels.binding import bind
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.prolongation import Prolongation
from pdvol.levels.space import LevelSpace
from shapes import box, together

COMM = MPI.COMM_WORLD


@pytest.fixture(scope="module", params=[2, 3])
def pair(request):
    """Two bodies; the fine points reach out of the coarse ones."""
    d = request.param
    coarse = together(box(d, 2, 0.1, 0.85, jitter=0.15), box(d, 2, 1.1, 1.9, jitter=0.15, seed=1))
    fine = together(box(d, 5, jitter=0.2, seed=2), box(d, 5, 1.0, 2.0, jitter=0.2, seed=3))
    coarse, fine = LevelSpace(coarse, COMM), LevelSpace(fine, COMM)
    return coarse, fine, Prolongation(coarse, fine, bind(fine, coarse))


def test_the_matrix_fits_vectors_of_both_spaces(pair):
    coarse, fine, prolongation = pair
    assert prolongation.matrix.getSizes() == (fine.create_vector().getSizes(), coarse.create_vector().getSizes())
    assert prolongation.matrix.getBlockSizes() == (fine.dim, fine.dim)


def test_matrix_serves_galerkin_products(pair):
    """PCMG needs P'AP with the fine matrix."""
    _, fine, prolongation = pair
    sizes = fine.create_vector().getSizes()
    identity = PETSc.Mat().createAIJ((sizes, sizes), bsize=fine.dim, nnz=1, comm=COMM)
    start, end = identity.getOwnershipRange()
    for row in range(start, end):
        identity.setValue(row, row, 1.0)
    identity.assemble()
    assert identity.ptap(prolongation.matrix).getSizes() == prolongation.matrix.getSizes()[1:] * 2


def test_report(pair):
    _, fine, prolongation = pair
    report = prolongation.report()
    dense = prolongation.weights().toarray()
    assert report["inside"] + report["ray"] + report["neighbour"] + report["orphans"] == len(fine.mesh.points)
    assert report["largest_weight"] == np.abs(dense).max() > 1.0
    assert report["frobenius_norm"] == pytest.approx(np.linalg.norm(dense), rel=1e-12)
    assert report["sqrt_points"] == np.sqrt(len(dense))
    assert report["two_norm"] == pytest.approx(np.linalg.norm(dense, 2), rel=1e-3)


def test_frobenius_norm_is_bounded_without_extrapolation():
    coarse, fine = LevelSpace(box(2, 3), COMM), LevelSpace(box(2, 7, 0.05, 0.95), COMM)
    report = Prolongation(coarse, fine, bind(fine, coarse)).report()
    assert report["inside"] == len(fine.mesh.points)
    assert report["frobenius_norm"] <= report["sqrt_points"] and report["largest_weight"] <= 1.0 + 1e-12


def test_hierarchy_is_a_sequence_with_lazy_prolongations():
    meshes = [box(2, n) for n in (1, 3, 7)]
    hierarchy = Hierarchy(meshes, COMM)
    assert len(hierarchy) == 3 and hierarchy[-1].mesh is meshes[2] and [s.mesh for s in hierarchy] == meshes
    prolongation = hierarchy.prolongation(2)
    assert prolongation is hierarchy.prolongation(2)
    assert prolongation.coarse is hierarchy[1] and prolongation.fine is hierarchy[2]
    for level in (0, 3, -1):
        with pytest.raises(ValueError, match="1 to 2"):
            hierarchy.prolongation(level)


def test_bad_hierarchies():
    with pytest.raises(ValueError, match="at least one level"):
        Hierarchy([], COMM)
    with pytest.raises(ValueError, match="barycentric"):
        Hierarchy([box(2, 1)], COMM, interpolant="nearest")


@pytest.mark.parametrize("limit, value, columns", [("MAX_COARSE_VERTICES", 63, 8), ("MAX_WEIGHTS", 1, None)])
def test_coarse_levels_that_cost_too_much_are_not_taken(monkeypatch, limit, value, columns):
    """A level of 64 vertices that is too large, and weights of more than one coarse vertex for each fine one."""
    hierarchy = Hierarchy([box(3, n) for n in (1, 3, 10)], MPI.COMM_WORLD)
    assert hierarchy.coarse_weights(2).shape[1] == 64
    monkeypatch.setattr("pdvol.levels.hierarchy." + limit, value)
    weights = hierarchy.coarse_weights(2)
    assert columns == (None if weights is None else weights.shape[1])


def test_the_coarse_level_for_linear_solvers():
    """The largest level that is small enough, through all prolongations between; none below the coarsest."""
    hierarchy = Hierarchy([box(3, n) for n in (1, 3, 10, 11)], MPI.COMM_WORLD)
    assert hierarchy.coarse_weights(0) is None
    assert hierarchy.coarse_weights(1) is None  # 64 vertices, 8 times those of level 0
    for level in (2, 3):  # 1,331 and 1,728 vertices: level 1 has 64, level 2 is not many times smaller
        weights = hierarchy.coarse_weights(level)
        assert weights.shape == (len(hierarchy[level].mesh.points), 64)
        fine = hierarchy[level].mesh.points
        np.testing.assert_allclose(weights @ hierarchy[1].mesh.points, fine, atol=1e-12)
        np.testing.assert_allclose(hierarchy.prolong(hierarchy[1].mesh.points, 1, level), fine, atol=1e-12)
        np.testing.assert_array_equal(hierarchy.prolong(fine, level, level), fine)
