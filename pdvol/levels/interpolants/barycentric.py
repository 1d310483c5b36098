"""Barycentric interpolation in the home cell, extrapolation outside it (paper 3.3.3). Reproduces affine fields."""

import numpy as np
import scipy.sparse as sp

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.binding import Binding
from pdvol.levels.space import LevelSpace


def barycentric(coarse: LevelSpace, fine: LevelSpace, binding: Binding) -> sp.csr_matrix:
    """Weights (n_fine, n_coarse): each row holds a fine point's coordinates in its home cell."""
    return binding_matrix(binding, coarse.mesh)


def binding_matrix(binding: Binding, source: LevelMesh) -> sp.csr_matrix:
    """(n bound points, n source points): each row holds a point's barycentric coordinates in its home cell of `source`.
    Not collective.
    """
    n, corners = binding.weights.shape
    columns = source.cells[binding.cells]
    indptr = np.arange(0, n * corners + 1, corners)
    # A copy: sorting the columns sorts the values in place, which are the binding's.
    weights = sp.csr_matrix(
        (binding.weights.ravel(), columns.ravel(), indptr), shape=(n, len(source.points)), copy=True
    )
    weights.sort_indices()
    return weights
