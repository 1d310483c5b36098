"""The coarse space of the two-level preconditioner: smooth displacements that a local preconditioner hardly corrects.

Each rank sums the Galerkin operator P' A P (contact included) from its own rows. The sum has some hundred vertices and
every rank factors and solves it. P is the prolongation from the hierarchy's own coarser levels. For a level without
them it consists of the multilinear hat functions of a regular background grid, evaluated at the mesh's points.
"""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_array

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly import native
from pdvol.potentials.assembly.native import pointer
from pdvol.solve.linear.system_matrix import BlockCsr, MatrixParts

# grid nodes over the square root of the level's vertices: every rank solves for all of them, and twice as many save
# only a tenth to a seventh of the iterations
GRID_NODES = 1.4
# sum of a node's weights below which it is left out: its row of P' A P would be nearly zero
MIN_NODE_WEIGHT = 1e-2
# share of the diagonal of P' A P that is added to it: nodes at the boundary can be nearly linearly dependent
COARSE_DIAGONAL_SHIFT = 1e-7


def grid_weights(mesh: LevelMesh) -> csr_array:
    """(n, m) values of a background grid's m multilinear hat functions at the mesh's n points. Each body has a grid of
    its own. Rows sum to one.
    """
    d, parts = mesh.dim, []
    nodes = round(GRID_NODES * len(mesh.points) ** 0.5) + 2**d
    bodies = np.unique(mesh.point_bodies)
    volumes = np.array([np.abs(mesh.volumes[mesh.bodies == body]).sum() for body in bodies])
    # A solid of volume V has about V / H^d nodes of spacing H inside, and those outside that its boundary cells have. H
    # is therefore enlarged until there are no more nodes than wanted; a few steps suffice.
    spacing = (volumes.sum() / nodes) ** (1.0 / d)
    for _ in range(20):
        parts = [_body_grid(mesh.points[mesh.point_bodies == body], spacing) for body in bodies]
        if sum(part.shape[1] for part in parts) <= nodes:
            break
        spacing *= 1.15
    offsets = np.cumsum([0, *(part.shape[1] for part in parts)])
    rows, columns, weights = [], [], []
    for body, part, offset in zip(bodies, parts, offsets, strict=False):
        entries = part.tocoo()
        rows.append(np.flatnonzero(mesh.point_bodies == body)[entries.row])
        columns.append(entries.col + offset)
        weights.append(entries.data)
    return csr_array(
        (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))),
        shape=(len(mesh.points), offsets[-1]),
    )


def _body_grid(points: np.ndarray, spacing: float) -> csr_array:
    """(n, m) values of the m hat functions of a grid round one body's points that are not zero at all of them."""
    d = points.shape[1]
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    # A whole number of boxes along each axis, so that none of them is mostly outside.
    boxes = np.maximum(1, np.round(size / spacing)).astype(int)
    scaled = (points - low) / np.maximum(size, 1e-300) * boxes
    corner = np.minimum(scaled.astype(int), boxes - 1)
    share = scaled - corner
    rows, columns, weights = [], [], []
    for shift in np.ndindex(*(2,) * d):
        columns.append(np.ravel_multi_index((corner + shift).T, boxes + 1))
        weights.append(np.prod(np.where(shift, share, 1.0 - share), axis=1))
        rows.append(np.arange(len(points)))
    columns = np.concatenate(columns)
    weights = np.concatenate(weights)
    used, columns = np.unique(columns, return_inverse=True)
    grid = csr_array((weights, (np.concatenate(rows), columns)), shape=(len(points), len(used)))
    grid.eliminate_zeros()
    return grid


class CoarseSpace:
    """The Galerkin operator P' A P, its factor, and the coarse correction. Construction is collective.

    Parameters
    ----------
    space : LevelSpace
    weights : (n, m) sparse
        P of one component, rows in input order.
    supported : (n,) bool, in PETSc's block order
        Vertices whose rows of P are set to zero.

    Attributes
    ----------
    size : number of coarse vertices
    """

    def __init__(self, space: LevelSpace, weights: csr_array, supported: np.ndarray):
        self.space, self._supported = space, supported
        order = np.argsort(space.point_blocks)
        P = csr_array(weights)[order]
        P = csr_array(P.multiply(~supported[:, None]))
        P.eliminate_zeros()
        P = csr_array(P[:, np.asarray(abs(P).sum(axis=0)).ravel() > MIN_NODE_WEIGHT])
        P.sort_indices()
        self.size: int = P.shape[1]
        self._solver: PETSc.KSP = None
        self._cell_pattern: np.ndarray | None = None
        self._keys: np.ndarray
        if self.size == 0:
            return
        self._starts, self._columns, self._weights = P.indptr.astype(np.int32), P.indices.astype(np.int32), P.data
        mine = self._starts[space.first_block :]  # rows of P
        self._arguments = (
            space.dim,
            space.n_owned,
            pointer(mine, "int32_t"),
            pointer(self._columns, "int32_t"),
            pointer(self._weights),
        )

    def update(self, parts: MatrixParts) -> None:
        """Sums and factors P' A P. Collective.

        Parameters
        ----------
        parts : MatrixParts
            Their sum is A's upper triangle, of this rank's rows.
        """
        if self._solver is None:
            self._find_pattern(parts)
        out = self._product(parts)
        if out[-1].any():
            self._find_pattern(parts)
            out = self._product(parts)
        d = self.space.dim
        out = out[:-1] + out[self._mirror].transpose(0, 2, 1)
        out = out[self._upper]
        out[self._diagonal, np.arange(d)[:, None], np.arange(d)[:, None]] *= 1.0 + COARSE_DIAGONAL_SHIFT
        self._matrix.setValuesBlockedCSR(*self._rows, out)
        self._matrix.assemble()
        self._solver.setOperators(self._matrix)
        self._solver.setUp()

    def _product(self, parts: MatrixParts) -> np.ndarray:
        """(k + 1, d, d) blocks of P' U P, where U is A's upper triangle with half its diagonal, summed over all ranks.
        The last one is the sum of all blocks that the pattern does not have.
        """
        out = np.zeros((len(self._keys) + 1, self.space.dim, self.space.dim))
        for starts, columns, blocks in parts:
            starts, columns = (
                np.ascontiguousarray(starts, dtype=np.int32),
                np.ascontiguousarray(columns, dtype=np.int32),
            )
            blocks = np.ascontiguousarray(blocks)
            if native.library().galerkin(
                self.space.dim,
                self.space.n_owned,
                self.space.first_block,
                pointer(starts, "int32_t"),
                pointer(columns, "int32_t"),
                pointer(blocks),
                pointer(self._starts, "int32_t"),
                pointer(self._columns, "int32_t"),
                pointer(self._weights),
                self.size,
                pointer(self._table, "int32_t"),
                pointer(out),
            ):
                raise MemoryError("no memory left for the coarse system")
        if self.space.comm.size > 1:
            self.space.comm.Allreduce(MPI.IN_PLACE, out, op=MPI.SUM)
        return out

    def forget(self) -> None:
        """Drops the blocks that contacts have added to the pattern, because the factor's last digits depend on it."""
        if self.size and self._solver is not None and len(self._keys) > self._cell_pattern_size:
            self._solver = None

    def _find_pattern(self, parts: MatrixParts) -> None:
        """Finds the blocks between coarse vertices that some cell or contact couples, and makes the matrix and its
        solver. Blocks of contacts that are gone stay in the pattern until `forget`. Collective.
        """
        m, d = self.size, self.space.dim
        if self._cell_pattern is None:
            self._cell_pattern = self._coupled(parts[0])
            self._cell_pattern_size = int(np.count_nonzero(self._cell_pattern))
        pattern = self._cell_pattern | self._coupled(parts[1])
        if self._solver is not None:
            pattern.ravel()[self._keys] = True
        self._keys = np.flatnonzero(pattern)
        self._table = np.full(m * m, len(self._keys), dtype=np.int32)
        self._table[self._keys] = np.arange(len(self._keys))
        row, column = self._keys // m, self._keys % m
        self._mirror = self._table[column * m + row]
        self._upper = np.flatnonzero(column >= row)
        self._diagonal = np.flatnonzero((row == column)[self._upper])
        upper = self._keys[self._upper]
        self._rows = (
            np.searchsorted(upper, np.arange(m + 1) * m).astype(PETSc.IntType),
            (upper % m).astype(PETSc.IntType),
        )
        self._matrix = PETSc.Mat().createSBAIJ(
            (m * d, m * d), d, csr=(*self._rows, np.zeros((len(upper), d, d))), comm=MPI.COMM_SELF
        )
        self._matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._solver = PETSc.KSP().create(MPI.COMM_SELF)
        self._solver.setType(PETSc.KSP.Type.PREONLY)
        self._solver.pc.setType(PETSc.PC.Type.CHOLESKY)
        self._solver.pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
        self._right, self._solution = self._matrix.createVecs()

    def _coupled(self, part: BlockCsr) -> np.ndarray:
        """(m, m) bool: pairs of coarse vertices that a block CSR of A's rows couples on some rank. Collective."""
        starts, columns, _ = part
        n, space = len(self.space.mesh.points), self.space
        P = csr_array((np.ones(len(self._columns), dtype=np.int32), self._columns, self._starts), shape=(n, self.size))
        mine = P[space.first_block : space.first_block + space.n_owned]
        couples = csr_array((np.ones(len(columns), dtype=np.int32), columns, starts), shape=(space.n_owned, n))
        pattern = (mine.T @ (couples @ P)).toarray() > 0
        space.comm.Allreduce(MPI.IN_PLACE, pattern, op=MPI.LOR)
        return pattern | pattern.T

    def add_correction(self, residual: np.ndarray, into: np.ndarray) -> None:
        """Adds P (P' A P)^-1 P' residual to `into`, for this rank's rows (n_owned d,) of each. Collective."""
        coarse = np.zeros(self.size * self.space.dim)
        native.library().restriction(*self._arguments, pointer(residual), pointer(coarse))
        if self.space.comm.size > 1:
            self.space.comm.Allreduce(MPI.IN_PLACE, coarse, op=MPI.SUM)
        self._right.setArray(coarse)
        self._solver.solve(self._right, self._solution)
        native.library().prolongation(*self._arguments, pointer(self._solution.getArray(readonly=True)), pointer(into))
