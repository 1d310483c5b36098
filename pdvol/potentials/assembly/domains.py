"""Where energy densities are evaluated: in a level's cells, or in the cells around each edge."""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_array

from pdvol.compiled import ffi, pointer
from pdvol.levels.space import LevelSpace
from pdvol.native import library


class Domains:
    """The parts of a level in each of which the deformation gradient is one matrix: F is the sum of x_a G_a' over the
    vertices a of a domain.

    Linear elements have a domain per cell. Smoothed ones (edge-smoothed finite elements: Liu, Nguyen-Thoi, Lam 2009; of
    large deformations: Lee, Mihai, Hale, Kerfriden, Bordas 2017) have one per edge and material. There F is the
    volume-weighted mean of the F of the cells around the edge, and the volume is a sixth of theirs (a third in 2D): a
    cell is divided among its edges.

    Parameters
    ----------
    chosen : (m,) bool
        The mesh's cells that are divided into domains.
    smoothing : (m,) int, optional
        Number of the material within which a cell's F is smoothed, -1 where it is not; not at all where not given.

    Attributes
    ----------
    cells : (k,) int64
        The mesh's cells of which the domains consist, of which some may lie in no domain.
    counted : how many domains count in sums of this rank; they come first
    volumes : (count,) [m^d]
    starts : (count + 1,) int64
        Where the vertices of each begin.
    vertices : (starts[-1],) int32
        Local vertices.
    """

    def __init__(self, space: LevelSpace, chosen: np.ndarray, smoothing: np.ndarray | None = None):
        self.space = space
        self.starts: np.ndarray
        self._mean: csr_array | None = None
        if smoothing is not None and (smoothing[chosen] >= 0).any():
            self._unite(*_parts(space, chosen, smoothing))
        else:
            near = np.flatnonzero(chosen[space.near_cells])
            self.cells, self.counted = space.near_cells[near], int(np.searchsorted(near, space.n_counted))
            self.volumes = np.abs(space.mesh.volumes[self.cells])
            self.vertices = np.ascontiguousarray(space.near_dofs[near]).ravel()
            self.starts = np.arange(len(near) + 1) * (space.dim + 1)
            self._gradients = np.ascontiguousarray(space.mesh.gradients_in(self.cells)[:, 1:])

    def _unite(self, keys: np.ndarray, cells: np.ndarray, volumes: np.ndarray) -> None:
        """Makes a domain of the parts (p,) with the same key: parts of these cells, with these volumes."""
        space, mesh = self.space, self.space.mesh
        first, last = space.first_block, space.first_block + space.n_owned
        blocks = space.point_blocks[mesh.cells]
        unique, domain = np.unique(keys, return_inverse=True)
        # As cells do, a domain counts for the rank that owns its lowest block, and the order is that of these blocks.
        lowest = np.full(len(unique), len(mesh.points))
        np.minimum.at(lowest, domain, blocks.min(axis=1)[cells])
        owned = ((blocks >= first) & (blocks < last)).any(axis=1)
        touches = np.bincount(domain, owned[cells], len(unique)) > 0.0
        order = np.lexsort((lowest, lowest < first))
        order = order[touches[order]]
        number = np.full(len(lowest), -1)
        number[order] = np.arange(len(order))
        kept = number[domain] >= 0
        domain, cells, volumes = number[domain][kept], cells[kept], volumes[kept]
        self.cells, column = np.unique(cells, return_inverse=True)
        self.counted = int(np.count_nonzero(lowest[order] >= first))
        self.volumes = np.bincount(domain, volumes, len(order))
        weights = volumes / self.volumes[domain]
        self._mean = csr_array((weights, (domain, column)), shape=(len(order), len(self.cells)))
        local = space.local_numbers[mesh.cells[cells]]
        pairs, corner = np.unique(domain[:, None] * len(space.local_points) + local, return_inverse=True)
        self.vertices = (pairs % len(space.local_points)).astype(np.int32)
        self.starts = np.searchsorted(pairs, np.arange(len(order) + 1) * len(space.local_points))
        others = np.delete(np.arange(len(pairs)), self.starts[:-1])
        hats = mesh.gradients_in(self.cells)
        parts = lambda axis: (hats[column, :, axis] * weights[:, None]).ravel()
        sums = [np.bincount(corner.ravel(), parts(axis), len(pairs))[others] for axis in range(space.dim)]
        self._gradients = np.column_stack(sums)

    @property
    def smoothed(self) -> bool:
        """Whether any domain may be more than a cell."""
        return self._mean is not None

    def __len__(self) -> int:
        return len(self.volumes)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """(count,): the volume-weighted means in the domains of the mesh's cells' values (m,)."""
        return values[self.cells] if self._mean is None else self._mean @ values[self.cells]

    def strains(self, x: np.ndarray) -> np.ndarray:
        """C = F'F (count, d, d) at local positions x (n_local, d)."""
        C = np.empty((len(self), self.space.dim, self.space.dim))
        library[self.space.dim].domain_strains(self.struct(0.0, False), pointer(x), pointer(C))
        return C

    def by_size(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Domains with equally many vertices: which (k,), and their local vertices (k, size)."""
        sizes = np.diff(self.starts)
        for size in np.unique(sizes):
            which = np.flatnonzero(sizes == size)
            yield which, self.vertices[self.starts[which][:, None] + np.arange(size)]

    def struct(self, ceiling: float, oriented: bool) -> object:
        """The C struct (interface.h); this object has to be kept."""
        sizes = {"count": len(self), "counted": self.counted}
        made = ffi.new("domains_t *", {**sizes, "ceiling": ceiling, "oriented": oriented})
        made.starts = pointer(self.starts, "int64_t") if self.smoothed else ffi.NULL
        made.vertices = pointer(self.vertices, "int32_t")
        made.gradients, made.volumes = pointer(self._gradients), pointer(self.volumes)
        return made


def _parts(space: LevelSpace, chosen: np.ndarray, smoothing: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The parts of cells that make domains: keys (p,) of the domains, cells (p,) and volumes (p,). A cell that is
    smoothed has a part for each edge.
    """
    mesh, n = space.mesh, len(space.mesh.points)
    known = np.flatnonzero(chosen & (space.local_numbers[mesh.cells] >= 0).all(axis=1))
    plain, smoothed = known[smoothing[known] < 0], known[smoothing[known] >= 0]
    one, other = np.triu_indices(space.dim + 1, 1)
    ends = mesh.cells[smoothed][:, [one, other]]
    edges = (smoothing[smoothed, None] * n + ends.min(axis=1)) * n + ends.max(axis=1)
    cells = np.concatenate([plain, np.repeat(smoothed, len(one))])
    fractions = np.repeat([1.0, 1.0 / len(one)], [len(plain), edges.size])
    return np.concatenate([-1 - plain, edges.ravel()]), cells, fractions * np.abs(mesh.volumes[cells])
