"""Random sums of Hessians that are the same on any number of ranks: springs between vertices."""

import numpy as np

from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from taylor import whole_matrix


def springs(space, seed=0, mass=1.0, pairs=True, stiff=1.0) -> HessianBlocks:
    """A positive definite sum: masses, springs along the edges of cells and, like contacts, between other vertices."""
    rng, mesh, d = np.random.default_rng(seed), space.mesh, space.dim
    blocks = HessianBlocks(BlockPattern(space))
    blocks.add_masses(np.full((space.n_owned, d), mass))
    ends = np.unique(np.sort(mesh.cells[:, np.stack(np.triu_indices(d + 1, 1), axis=1)].reshape(-1, 2)), axis=0)
    if pairs:
        # More than a pair at a place, and pairs where cells are.
        ends = np.concatenate([ends, rng.integers(0, len(mesh.points), (20, 2)), ends[:5], ends[:5]])
    ends = ends[ends[:, 0] != ends[:, 1]]
    normals = rng.standard_normal((len(ends), d))
    normals[-20:] *= stiff**0.5
    one, other = np.sort(space.point_blocks[ends], axis=1).T
    middle = normals[:, :, None] * normals[:, None, :]
    for row, column, sign in ((one, one, 1.0), (other, other, 1.0), (one, other, -1.0), (other, one, -1.0)):
        blocks.add_pairs(row, column, sign * middle)
    return blocks


def dense(space, blocks, supported=None) -> np.ndarray:
    """The whole matrix (n d, n d), in PETSc's order, with supported rows (n,) eliminated; on one rank."""
    found = whole_matrix(blocks).toarray()
    if supported is not None:
        rows = np.repeat(supported, space.dim)
        found[rows] = found[:, rows] = 0.0
        found[rows, rows] = 1.0
    return found
