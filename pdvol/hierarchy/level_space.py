"""A level's distributed finite-element space, and the way between its numbering and the input's vertex order."""

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from pdvol import compat
from pdvol.hierarchy.level_mesh import LevelMesh


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
        Input index of each owned (owned and ghost) block of unknowns on this rank.
    point_blocks : (n,) int64
        Global (PETSc) block index of each input point, replicated.
    """

    def __init__(self, mesh: LevelMesh, comm: MPI.Comm):
        self.mesh, self.comm = mesh, comm
        self.domain = compat.create_mesh(comm, mesh.points, mesh.cells)
        self.V = fem.functionspace(self.domain, ("Lagrange", 1, (mesh.dim,)))
        index_map = self.V.dofmap.index_map
        self.n_owned = index_map.size_local
        self.first_block = int(index_map.local_range[0])
        self.local_points = np.empty(self.n_owned + index_map.num_ghosts, dtype=np.int64)
        geometry = self.domain.geometry
        self.local_points[self.V.dofmap.list] = np.asarray(geometry.input_global_indices)[compat.geometry_dofmap(self.domain)]
        self.owned_points = self.local_points[: self.n_owned]
        self._global_order = np.concatenate(comm.allgather(self.owned_points))
        self._counts = np.array(comm.allgather(self.n_owned * mesh.dim))
        self._ghosted = la.vector(index_map, mesh.dim)
        self.point_blocks = np.empty(len(mesh.points), dtype=np.int64)
        self.point_blocks[self._global_order] = np.arange(len(mesh.points))

    @property
    def dim(self) -> int:
        return self.mesh.dim

    @property
    def local_cells(self) -> np.ndarray:
        """(m_local,) int64: input index of each cell on this rank, ghosts last."""
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
        """Owned and ghost rows (n_local, d) from owned rows (n_owned, d). Collective."""
        self._ghosted.array[: owned.size] = owned.ravel()
        self._ghosted.scatter_forward()
        return self._ghosted.array.reshape(-1, self.dim).copy()

    def add_ghosts(self, local: np.ndarray) -> np.ndarray:
        """Owned rows (n_owned, d) after each ghost row of `local` (n_local, d) was added to its owner's. Collective."""
        self._ghosted.array[:] = local.ravel()
        self._ghosted.scatter_reverse(la.InsertMode.add)
        return self._ghosted.array[: self.n_owned * self.dim].reshape(-1, self.dim).copy()
