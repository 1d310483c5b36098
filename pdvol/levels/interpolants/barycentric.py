"""Barycentric interpolation in the home cell, extrapolation outside it (paper 3.3.3). Reproduces affine fields."""

import scipy.sparse as sp

from pdvol.levels.binding import Binding
from pdvol.levels.space import LevelSpace


def barycentric(coarse: LevelSpace, fine: LevelSpace, binding: Binding) -> sp.csr_matrix:
    """Weights (n_fine, n_coarse): each row holds a fine point's coordinates in its home cell."""
    return binding.matrix(coarse.mesh)
