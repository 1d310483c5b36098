"""Levels in a row, and the coarse ones that linear solvers take."""

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.levels.hierarchy import Hierarchy
from shapes import box

COMM = MPI.COMM_WORLD


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
