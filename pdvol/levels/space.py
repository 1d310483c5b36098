"""A level's distributed finite-element space, and the way between its numbering and the input's vertex order."""

from typing import TypeVar

import numpy as np
from mpi4py import MPI

from pdvol import compat
from pdvol.compat import PETSc, fem, la
from pdvol.errors import InputError
from pdvol.geometry.level_mesh import LevelMesh, connected_parts, simplex_volumes
from pdvol.levels.partition import shared_cells

Value = TypeVar("Value")


class Collected:
    """Rows that ranks have a part of each, together on all of them. Construction is collective.

    Parameters
    ----------
    comm : MPI.Comm
    numbers : (k_own,) int64
        The place of each of this rank's rows among all ranks', in which each place occurs once.
    """

    def __init__(self, comm: MPI.Comm, numbers: np.ndarray):
        self._comm, parts = comm, comm.allgather(np.asarray(numbers, dtype=np.int64))
        self.order = np.concatenate(parts)
        self._counts = np.array([len(part) for part in parts])

    def __call__(self, own: np.ndarray) -> np.ndarray:
        """(k, d) all rows at their places, from this rank's (k_own, d). Collective."""
        d = own.shape[1]
        everything = own
        if self._comm.size > 1:  # on one rank MPI's copy takes longer than all else here
            everything = np.empty((len(self.order), d))
            self._comm.Allgatherv(np.ascontiguousarray(own, dtype=np.float64), [everything, d * self._counts])
        result = np.empty((len(self.order), d))
        result[self.order] = everything
        return result


class LevelSpace:
    """P1 vector space on a `LevelMesh`, distributed over `comm`. Construction is collective.

    Parameters
    ----------
    mesh : LevelMesh
    comm : MPI.Comm
    places : (n, d) [m]
        Positions by which `shared_cells` divides the cells among the ranks.

    Attributes
    ----------
    mesh : LevelMesh
        The whole level, replicated, in the input's order.
    domain : dolfinx.mesh.Mesh
    V : dolfinx.fem.FunctionSpace
        Vector P1; block size `dim`.
    owned_points, local_points : (n_owned,), (n_local,) int64
        Input index of each vertex whose unknowns this rank owns; and behind those of the other vertices of
        `near_cells` and of the cells that have an edge of these.
    local_numbers : (n,) int32
        The place in `local_points` of each input point, -1 where it has none.
    local_blocks : (n_local,) int64
        Global (PETSc) block index of each local vertex.
    rank_ends : (ranks,) int64
        Global block index behind the last of each rank.
    point_blocks : (n,) int64
        Global block index of each input point, replicated.
    near_cells : (m_near,) int64
        Input index of the cells that touch an owned vertex: sums over them are complete in owned rows without any
        message. The first `n_counted` belong to this rank alone, and all ranks' are all cells.
    near_dofs : (m_near, d + 1) int32
        Local indices of their vertices.
    """

    def __init__(self, mesh: LevelMesh, comm: MPI.Comm, places: np.ndarray | None = None):
        domain = compat.create_mesh(comm, mesh.points, mesh.cells, shared_cells(mesh, comm.size, places))
        V = fem.functionspace(domain, ("Lagrange", 1, (mesh.dim,)))
        points = _of_blocks(V, np.asarray(domain.geometry.input_global_indices))
        self._number(mesh, V, points[: V.dofmap.index_map.size_local])

    @classmethod
    def of(cls, V: fem.FunctionSpace) -> "LevelSpace":
        """The space of a user's own function space, whose numbering and distribution it keeps. Collective.

        Points and cells of `mesh` are in the order of the arrays that the dolfinx mesh was made from, which does not
        depend on the number of ranks. Connected parts of the mesh are its bodies, in the order of their first points.

        Parameters
        ----------
        V : dolfinx.fem.FunctionSpace
            Vector P1 on straight triangles (2D) or tetrahedra (3D), with as many components as dimensions.

        Raises
        ------
        InputError
            It is another kind of space. On all ranks, before any communication.
        """
        _require_vector_p1(V)
        space = cls.__new__(cls)
        space._number(*_replicated(V))
        return space

    def _number(self, mesh: LevelMesh, V: fem.FunctionSpace, owned_points: np.ndarray) -> None:
        self.mesh, self.V, self.domain, self.comm, self.dim = mesh, V, V.mesh, V.mesh.comm, mesh.dim
        index_map = V.dofmap.index_map
        self.n_owned = index_map.size_local
        self.first_block = int(index_map.local_range[0])
        self.owned_points = owned_points
        self._collected = Collected(self.comm, self.owned_points)
        self.rank_ends = np.cumsum(self.comm.allgather(self.n_owned))
        self.point_blocks = np.empty(len(mesh.points), dtype=np.int64)
        self.point_blocks[self._collected.order] = np.arange(len(mesh.points))
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
        # Cells that share an edge with a near cell may be smoothed together with it.
        reached = np.zeros(len(self.mesh.points), dtype=bool)
        reached[self.mesh.cells[touching]] = True
        beside = self.point_blocks[self.mesh.cells[reached[self.mesh.cells].sum(axis=1) >= 2]]
        ghosts = np.unique(beside[(beside < first) | (beside >= last)])
        self.local_blocks = np.concatenate([np.arange(first, last), ghosts])
        self.local_points = self._collected.order[self.local_blocks]
        self.local_numbers = np.full(len(self.mesh.points), -1, dtype=np.int32)
        self.local_numbers[self.local_points] = np.arange(len(self.local_points))
        self.near_dofs = np.ascontiguousarray(self.local_numbers[self.mesh.cells[self.near_cells]])
        halo = compat.index_map(
            self.comm, self.n_owned, ghosts, np.searchsorted(self.rank_ends, ghosts, side="right").astype(np.int32)
        )
        self._halo = la.vector(halo, d)

    @property
    def domain_cells(self) -> np.ndarray:
        """(m_local,) int64: input index of each cell of `domain` on this rank, ghosts last."""
        return np.asarray(self.domain.topology.original_cell_index)

    def reduce(self, value: Value, op: MPI.Op = MPI.SUM) -> Value:
        """The sum of all ranks' numbers, or what else `op` makes of them, of the same type. Collective."""
        if self.comm.size == 1:
            return value  # an iteration asks many times, and mpi4py takes 12 us on one rank
        numbers = np.array(value, ndmin=1, dtype=np.int32 if op in (MPI.LAND, MPI.LOR) else np.float64)
        self.comm.Allreduce(MPI.IN_PLACE, numbers, op=op)
        return numbers if isinstance(value, np.ndarray) else type(value)(numbers[0])  # type: ignore[return-value, call-arg]

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
        return self._collected(owned)

    def function(self, values: np.ndarray, name: str) -> fem.Function:
        """The P1 field of an array (n, d) in input order, ghosts included. Collective."""
        field = fem.Function(self.V, name=name)
        field.x.array[: self.n_owned * self.dim] = self.from_input(values).ravel()
        field.x.scatter_forward()
        return field

    def cell_function(self, values: np.ndarray, name: str) -> fem.Function:
        """The field that is constant in each cell, from an array (m,) in input order. Collective."""
        field = fem.Function(fem.functionspace(self.domain, ("DG", 0)), name=name)
        field.x.array[np.asarray(field.function_space.dofmap.list)[:, 0]] = values[self.domain_cells]
        return field

    def with_ghosts(self, owned: np.ndarray) -> np.ndarray:
        """Local rows (n_local, d) from owned rows (n_owned, d). Collective."""
        if self.comm.size == 1:
            return owned
        self._halo.array[: owned.size] = owned.ravel()
        self._halo.scatter_forward()
        return self._halo.array.reshape(-1, self.dim).copy()


def _of_blocks(V: fem.FunctionSpace, values: np.ndarray) -> np.ndarray:
    """Values of geometry nodes (k, ...) for the blocks of P1 on this rank, owned ones first."""
    index_map = V.dofmap.index_map
    found = np.empty((index_map.size_local + index_map.num_ghosts, *values.shape[1:]), dtype=values.dtype)
    found[V.dofmap.list] = values[compat.geometry_dofmap(V.mesh)]
    return found


def _require_vector_p1(V: fem.FunctionSpace) -> None:
    """InputError unless V is vector P1 on straight simplices."""
    if not isinstance(V, fem.FunctionSpace):
        raise InputError(f"contact needs a dolfinx FunctionSpace, not {type(V).__name__}")
    domain, element = V.mesh, V.ufl_element()
    cell, d = domain.topology.cell_name(), domain.topology.dim
    if cell not in ("triangle", "tetrahedron") or domain.geometry.dim != d:
        raise InputError(
            f"contact needs a mesh of triangles in 2D or of tetrahedra in 3D, not of {cell}s in {domain.geometry.dim}D"
        )
    if len(compat.geometry_dofmap(domain)) and compat.geometry_dofmap(domain).shape[1] != d + 1:
        raise InputError("contact needs straight cells; make the mesh with a geometry of degree 1")
    if V.component() or element.num_sub_elements > 1 and element.block_size == 1:
        raise InputError("contact needs displacements alone; of a mixed space V give V.sub(0).collapse()[0]")
    plain = element.family_name == "P" and element.degree == 1 and not element.discontinuous
    if not plain or V.dofmap.bs != d:
        raise InputError(f'contact needs displacements in ("Lagrange", 1, ({d},)), not in {element}')


def _replicated(V: fem.FunctionSpace) -> tuple[LevelMesh, fem.FunctionSpace, np.ndarray]:
    """The whole mesh of V on every rank, V, and the point (n_owned,) of each owned block. Collective."""
    domain, d, index_map = V.mesh, V.mesh.topology.dim, V.dofmap.index_map
    n = index_map.size_local
    together = lambda values: np.concatenate(domain.comm.allgather(np.ascontiguousarray(values)))
    rest = together(_of_blocks(V, domain.geometry.x[:, :d])[:n])
    place = _ranks_of(together(_of_blocks(V, np.asarray(domain.geometry.input_global_indices))[:n]))
    points = np.empty_like(rest, dtype=np.float64)
    points[place] = rest
    own = domain.topology.index_map(d).size_local
    numbers = np.asarray(domain.topology.original_cell_index)
    if len(numbers) < own:  # a submesh has none
        numbers = domain.topology.index_map(d).local_range[0] + np.arange(own)
    blocks = index_map.local_to_global(V.dofmap.list[:own].ravel().astype(np.int32)).reshape(-1, d + 1)
    cells = np.empty((domain.topology.index_map(d).size_global, d + 1), dtype=np.int64)
    # Corners in a row, so that nothing depends on how dolfinx turned a cell; then the last two so that it is positive.
    cells[_ranks_of(together(numbers[:own]))] = np.sort(place[together(blocks)], axis=1)
    turned = simplex_volumes(points, cells) < 0.0
    cells[turned, -2:] = cells[turned, :-3:-1]
    mesh = LevelMesh(
        points,
        cells,
        connected_parts(cells, len(points)).astype(np.int32)[cells[:, 0]],
        np.zeros(len(cells), dtype=np.int32),
    )
    first = int(index_map.local_range[0])
    return mesh, V, place[first : first + n]


def _ranks_of(indices: np.ndarray) -> np.ndarray:
    """(k,) int64: how many of the indices (k,) are smaller than each; their own order where some are alike."""
    order = np.argsort(indices, kind="stable")
    ranks = np.empty(len(indices), dtype=np.int64)
    ranks[order] = np.arange(len(indices))
    return ranks
