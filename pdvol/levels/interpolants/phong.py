"""Phong Deformation (James 2020; paper 3.4.2): a quadratic interpolant from vertex-averaged deformation gradients.

With the barycentric coordinates b_j of a fine point X in its home cell, corners X_j moved to x_j, and F_j the
volume-weighted mean of the deformation gradients of the cells around corner j,

    x = 1/2 sum_j b_j x_j  +  1/2 sum_j b_j (x_j + F_j (X - X_j)).

For a quadratic field whose vertex gradients are exact, the errors of the two halves are opposite: the mean is exact.
Affine fields are reproduced always, since then F_j = F and sum_j b_j (X - X_j) = 0. Outside the home cell the b_j are
partly negative and the second half grows with the square of the distance.
"""

import numpy as np
import scipy.sparse as sp

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.binding import Binding
from pdvol.levels.space import LevelSpace


def phong(coarse: LevelSpace, fine: LevelSpace, binding: Binding) -> sp.csr_matrix:
    """Weights (n_fine, n_coarse): a fine point depends on its home cell's corners and their neighbours."""
    linear = binding.matrix(coarse.mesh)
    weights = linear.copy()
    point = np.repeat(np.arange(linear.shape[0]), np.diff(linear.indptr))
    offsets = fine.mesh.points[point] - coarse.mesh.points[linear.indices]
    for along, gradient in zip(offsets.T, vertex_gradients(coarse.mesh), strict=True):
        arms = sp.csr_matrix((0.5 * linear.data * along, linear.indices, linear.indptr), shape=linear.shape)
        weights = weights + arms @ gradient
    weights.sort_indices()
    return weights


def vertex_gradients(mesh: LevelMesh) -> list[sp.csr_matrix]:
    """d matrices (n, n) [1/m], one per axis: a P1 field's derivative at vertices, volume-weighted means over cells."""
    n, corners = len(mesh.points), mesh.dim + 1
    around = np.bincount(mesh.cells.ravel(), np.repeat(mesh.volumes, corners), minlength=n)
    row, column = np.repeat(mesh.cells, corners, axis=1).ravel(), np.tile(mesh.cells, (1, corners)).ravel()
    fraction = np.repeat(mesh.volumes, corners**2) / around[row]
    gradients = np.tile(mesh.hat_gradients, (1, corners, 1)).reshape(-1, mesh.dim)
    return [sp.csr_matrix((fraction * derivative, (row, column)), shape=(n, n)) for derivative in gradients.T]
