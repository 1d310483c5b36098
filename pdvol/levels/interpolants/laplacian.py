"""A squared Laplacian A = L' M^-1 L whose kernel is the affine functions, boundary included.

L has a row per inner facet: the jump of a P1 field's gradient there, which is all the Laplacian that such a field has,

    (L u)_f = |f| (n_a . grad u_a + n_b . grad u_b)      a, b the cells beside f, n_a = -n_b their normals away from f,

and M_f = (|a| + |b|) / (d + 1): the lumped Crouzeix-Raviart Laplacian. Facets of the boundary have no row: nothing is
asked of the normal derivative there (natural boundary conditions). A field without such jumps is affine on every part
joined through facets, hence the kernel.

The cotangent Laplacian, which imposes no flux through the boundary, does not annihilate affine functions at boundary
vertices. Wang et al. (2015) added their flux back; libigl keeps that variant out of use with a note by its authors that
it is in error, and has this one.
"""

import numpy as np
import scipy.sparse as sp

from pdvol.geometry.level_mesh import LevelMesh


def flux_laplacian(mesh: LevelMesh) -> sp.csr_matrix:
    """L: (inner facets, n) [m^(d-2)]."""
    cells, opposite = mesh.inner_facets
    gradients = mesh.hat_gradients[cells]
    # A facet's area vector, into the cell, is d |cell| grad phi_opposite.
    area = (
        mesh.dim
        * mesh.volumes[cells][..., None]
        * np.take_along_axis(gradients, opposite[..., None, None], axis=2)[:, :, 0]
    )
    flux = (gradients @ area[..., None])[..., 0]
    rows = np.broadcast_to(np.arange(len(cells))[:, None, None], flux.shape)
    return sp.csr_matrix(
        (flux.ravel(), (rows.ravel(), mesh.cells[cells].ravel())), shape=(len(cells), len(mesh.points))
    )


def squared_laplacian(mesh: LevelMesh) -> sp.csr_matrix:
    """A: (n, n) [m^(d-4)], symmetric and positive semi-definite."""
    laplacian = flux_laplacian(mesh)
    masses = mesh.volumes[mesh.inner_facets[0]].sum(axis=1) / (mesh.dim + 1)
    return (laplacian.T @ sp.diags(1.0 / masses) @ laplacian).tocsr()
