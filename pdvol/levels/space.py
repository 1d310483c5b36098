"""A level's distributed finite-element space, and the way between its numbering and the input's vertex order."""

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from pdvol import compat
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.partition import shared_bodies


class LevelSpace:
    """P1 vector space on a `LevelMesh`, distributed over `comm`. Construction is collective.

    Attributes
    ----------
    mesh : LevelMesh
        The whole level, replicated, in the input's order.
    domain : dolfinx.mesh.Mesh
    V : dolfinx.fem.FunctionSpace
        Vector P1; block size `dim`.
    owned_points, local_points : (n_owned,), (n_local,) int64
        Input index of each vertex whose unknowns this rank owns; and behind those of the other vertices of
        `near_cells`.
    local_blocks : (n_local,) int64
        Global (PETSc) block index of each local vertex.
    point_blocks : (n,) int64
        Global block index of each input point, replicated.
    near_cells : (m_near,) int64
        Input index of the cells that touch an owned vertex: sums over them are complete in owned rows without any
        message. The first `n_counted` belong to this rank alone, and all ranks' are all cells.
    near_dofs : (m_near, d + 1) int32
        Local indices of their vertices.
    """

    def __init__(self, mesh: LevelMesh, comm: MPI.Comm):
        self.mesh, self.comm = mesh, comm
        several = comm.size > 1 and mesh.bodies.max() > 0
        self.domain = compat.create_mesh(
            comm, mesh.points, mesh.cells, shared_bodies(mesh, comm.size) if several else None
        )
        self.V = fem.functionspace(self.domain, ("Lagrange", 1, (mesh.dim,)))
        index_map = self.V.dofmap.index_map
        self.n_owned = index_map.size_local
        self.first_block = int(index_map.local_range[0])
        points = np.empty(self.n_owned + index_map.num_ghosts, dtype=np.int64)
        geometry = self.domain.geometry
        points[self.V.dofmap.list] = np.asarray(geometry.input_global_indices)[compat.geometry_dofmap(self.domain)]
        self.owned_points = points[: self.n_owned]
        self._global_order = np.concatenate(comm.allgather(self.owned_points))
        self._counts = np.array(comm.allgather(self.n_owned * mesh.dim))
        self.point_blocks = np.empty(len(mesh.points), dtype=np.int64)
        self.point_blocks[self._global_order] = np.arange(len(mesh.points))
        self._find_near_cells()

    def _find_near_cells(self) -> None:
        blocks, d = self.point_blocks[self.mesh.cells], self.dim
        first, last = self.first_block, self.first_block + self.n_owned
        touching = np.flatnonzero(((blocks >= first) & (blocks < last)).any(axis=1))
        # A cell counts for the rank that owns its lowest block; cells in the order of their blocks keep memory close.
        lowest = blocks[touching].min(axis=1)
        order = np.lexsort((lowest, lowest < first))
        self.near_cells, blocks = touching[order], blocks[touching[order]]
        self.n_counted = int(np.count_nonzero(lowest >= first))
        ghosts = np.unique(blocks[(blocks < first) | (blocks >= last)])
        self.local_blocks = np.concatenate([np.arange(first, last), ghosts])
        self.local_points = self._global_order[self.local_blocks]
        local = np.empty(len(self.mesh.points), dtype=np.int32)
        local[self.local_blocks] = np.arange(len(self.local_blocks))
        self.near_dofs = np.ascontiguousarray(local[blocks])
        ends = np.cumsum(self._counts // d)
        halo = compat.index_map(
            self.comm, self.n_owned, ghosts, np.searchsorted(ends, ghosts, side="right").astype(np.int32)
        )
        self._halo = la.vector(halo, d)

    @property
    def dim(self) -> int:
        return self.mesh.dim

    @property
    def domain_cells(self) -> np.ndarray:
        """(m_local,) int64: input index of each cell of `domain` on this rank, ghosts last."""
        return np.asarray(self.domain.topology.original_cell_index)

    def create_vector(self) -> PETSc.Vec:
        """A PETSc vector of positions, without ghosts, with the matrix's row layout."""
        n = self.dim
        vec = PETSc.Vec().create(comm=self.comm)
        vec.setSizes((self.n_owned * n, len(self.mesh.points) * n), bsize=n)
        vec.setUp()
        return vec

    def from_input(self, values: np.ndarray) -> np.ndarray:
        """Owned rows (n_owned, d) of an array (n, d) in input order."""
        return np.ascontiguousarray(values[self.owned_points])

    def to_input(self, owned: np.ndarray) -> np.ndarray:
        """The whole array (n, d), in input order and on every rank, from each rank's owned rows. Collective."""
        owned = np.ascontiguousarray(owned, dtype=np.float64)
        everything = np.empty((len(self.mesh.points), self.dim))
        self.comm.Allgatherv(owned, [everything, self._counts])
        result = np.empty_like(everything)
        result[self._global_order] = everything
        return result

    def with_ghosts(self, owned: np.ndarray) -> np.ndarray:
        """Local rows (n_local, d) from owned rows (n_owned, d). Collective."""
        if self.comm.size == 1:
            return owned
        self._halo.array[: owned.size] = owned.ravel()
        self._halo.scatter_forward()
        return self._halo.array.reshape(-1, self.dim).copy()
