"""Barycentric interpolation in the home cell, extrapolation outside it (paper 3.3.3). Reproduces affine fields."""

import numpy as np
import scipy.sparse as sp

from pdvol.hierarchy.binding import Binding
from pdvol.hierarchy.level_space import LevelSpace


def barycentric(coarse: LevelSpace, fine: LevelSpace, binding: Binding) -> sp.csr_matrix:
    """Weights (n_fine, n_coarse): each row holds a fine point's coordinates in its home cell."""
    n, corners = binding.weights.shape
    columns = coarse.mesh.cells[binding.cells]
    indptr = np.arange(0, n * corners + 1, corners)
    # A copy: sorting the columns sorts the values in place, which are the binding's.
    weights = sp.csr_matrix((binding.weights.ravel(), columns.ravel(), indptr), shape=(n, len(coarse.mesh.points)), copy=True)
    weights.sort_indices()
    return weights
