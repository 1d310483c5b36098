"""How much a level's mesh is stretched: principal stretches of its cells, and strain by vertex."""

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh


def principal_stretches(mesh: LevelMesh, positions: np.ndarray) -> np.ndarray:
    """(m, d): singular values of each cell's deformation gradient, descending; `positions` (n, d) [m]."""
    gradients = np.einsum("mci,mcj->mij", positions[mesh.cells], mesh.hat_gradients)
    return np.linalg.svd(gradients, compute_uv=False)


def vertex_strain(mesh: LevelMesh, positions: np.ndarray) -> np.ndarray:
    """(n,): the largest |principal stretch - 1| of the cells about each vertex, a mean over their volumes at rest;
    `positions` (n, d) [m].
    """
    corners, count = mesh.cells.ravel(), len(mesh.points)
    volumes = np.repeat(mesh.volumes, mesh.dim + 1)
    largest = np.repeat(abs(principal_stretches(mesh, positions) - 1.0).max(axis=1), mesh.dim + 1)
    return np.bincount(corners, volumes * largest, count) / np.bincount(corners, volumes, count)
