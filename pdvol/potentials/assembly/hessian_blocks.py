"""The sum of the terms' Hessians: d x d blocks of this rank's rows, on or right of the diagonal, and all that couple
them with other ranks' vertices.

The sparsity pattern of a level's Hessian from its cells: upper triangle, in blocks. Built once per level.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pdvol.compiled import ffi, integers, pointer
from pdvol.levels.space import LevelSpace
from pdvol.native import AHEAD, library
from pdvol.potentials.assembly.domains import Domains

BlockCsr = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Blocks of this rank's rows: starts (n_owned + 1,) int32, global columns (k,) int32 that ascend, blocks (k, d, d).

The array of blocks has SPARE numbers behind its last block, which compiled products may read.
"""
SPARE = 4
# code of block s that is added transposed: TRANSPOSED - s, as elements.c decodes it
TRANSPOSED = -2
# code of a block in another rank's rows, which is not added
ELSEWHERE = -1
# treatment of negative eigenvalues: its number in the C code (`mode` in elements.c and isotropic.c)
FILTERS = {"none": 0, "clamp": 1, "abs": 2}


class BlockPattern:
    """Blocks (d x d) in this rank's rows, on or right of the diagonal or in columns of lower ranks, in global block
    numbering: between the vertices of each near cell, and of each domain of `stencils`.

    Attributes
    ----------
    count : number of blocks
    rows, columns : (count,) int64, int32
        Local row and global column of each block, sorted.
    starts : (n_owned + 1,) int32
        Where each row's blocks begin.
    diagonal : (n_owned,)
        Which blocks lie on the diagonal.
    entries : (n_owned, d)
        Where the diagonal's numbers are among those of all blocks.
    slots : for each of `stencils`, int32
        Block index of each pair i <= j of each domain's vertices, domain by domain, with the codes above for blocks
        that are added transposed or not stored, and spare ones at the end.
    """

    def __init__(self, space: LevelSpace, stencils: Sequence[Domains] = ()):
        self.space = space
        n = len(space.mesh.points)
        corners = (vertices for domains in stencils if domains.smoothed for _, vertices in domains.by_size())
        pairs = (self._keys(vertices) for vertices in (space.near_dofs, *corners))
        unique = np.unique(np.concatenate([np.unique(keys[stored]) for keys, stored, _ in pairs]))
        self._unique, self.count = unique, len(unique)
        self.rows, self.columns = unique // n, (unique % n).astype(np.int32)
        self.starts = np.searchsorted(unique, np.arange(space.n_owned + 1) * n).astype(np.int32)
        self.diagonal = np.searchsorted(
            unique, np.arange(space.n_owned) * n + space.first_block + np.arange(space.n_owned)
        )
        d = space.dim
        self.entries = d * d * self.diagonal[:, None] + (d + 1) * np.arange(d)
        self.slots = {domains: self._find_slots(domains) for domains in stencils}

    def _keys(self, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A number (k, p) for the block of each pair i <= j of local vertices (k, size), which ascends by rows and
        columns; whether it is stored; and whether i is its column.
        """
        space = self.space
        i, j = np.triu_indices(vertices.shape[1])
        blocks = space.local_blocks[vertices]
        one, other = blocks[:, i], blocks[:, j]
        lower = np.minimum(one, other)
        row = np.where(lower < space.first_block, np.maximum(one, other), lower)
        stored = (row >= space.first_block) & (row < space.first_block + space.n_owned)
        return (row - space.first_block) * len(space.mesh.points) + one + other - row, stored, one != row

    def _find_slots(self, domains: Domains) -> np.ndarray:
        sizes = np.diff(domains.starts)
        begins = np.concatenate([[0], np.cumsum(sizes * (sizes + 1) // 2)])
        found = np.full(begins[-1] + AHEAD, ELSEWHERE, dtype=np.int32)
        for which, vertices in domains.by_size():
            keys, stored, turned = self._keys(vertices)
            slot = np.searchsorted(self._unique, keys)
            places = begins[which][:, None] + np.arange(keys.shape[1])
            found[places[stored]] = np.where(turned, TRANSPOSED - slot, slot)[stored]
        return found


class HessianBlocks:
    """A symmetric matrix being summed, of which this rank holds its rows' upper triangle and all of their blocks in
    other ranks' columns: products need no message but the vector's.

    Attributes
    ----------
    pattern : BlockPattern
    projection : "clamp", "abs" or "none"
        Negative eigenvalues of the terms' local Hessians are set to zero, replaced by their absolute values, or kept.
    cells : (pattern.count, d, d)
        Blocks between vertices of a cell, in the pattern's order.
    count : number of blocks that `add_pairs` and `add_compiled` have added
    """

    def __init__(self, pattern: BlockPattern, projection: str = "clamp"):
        self.pattern, self.projection = pattern, projection
        d = pattern.space.dim
        self.cells = np.zeros((pattern.count, d, d))
        self.count = self._kept = 0
        self._rows, self._columns = (np.empty(0, dtype=np.int64) for _ in range(2))
        self._blocks: np.ndarray = np.empty((0, d, d))
        self._merged = room_of_rows(pattern.space.n_owned, 0, d)

    @property
    def added(self) -> BlockCsr:
        """What was added: local rows (k,) int64, global columns (k,) int64 and blocks (k, d, d); not to be kept."""
        return self._rows[: self.count], self._columns[: self.count], self._blocks[: self.count]

    def clear(self) -> None:
        """Back to zero."""
        self.cells[:] = 0.0
        self.count = 0

    def keep_added(self) -> None:
        """Marks the pairs added so far as those that `drop_later` keeps."""
        self._kept = self.count

    def drop_later(self) -> None:
        """Removes the pairs added since the last `keep_added`."""
        self.count = self._kept

    def finite(self) -> bool:
        """Whether all blocks of this rank are finite."""
        return bool(np.isfinite(self.cells.sum()) and np.isfinite(self._blocks[: self.count].sum()))

    def add_diagonal(self, vertices: np.ndarray, blocks: np.ndarray) -> None:
        """Adds blocks (k, d, d) on the diagonal at owned vertices (k,), which may repeat."""
        np.add.at(self.cells, self.pattern.diagonal[vertices], blocks)

    def add_masses(self, masses: np.ndarray) -> None:
        """Adds a diagonal matrix, given by its entries (n_owned, d)."""
        self.cells.reshape(-1)[self.pattern.entries] += masses

    def add_pairs(self, rows: np.ndarray, columns: np.ndarray, blocks: np.ndarray) -> None:
        """Adds blocks (k, d, d) of both triangles at global block indices (k,), which may repeat. Those that this rank
        does not hold are ignored.
        """
        first, last = self.pattern.space.first_block, self.pattern.space.first_block + self.pattern.space.n_owned
        kept = (rows >= first) & (rows < last) & ((columns >= rows) | (columns < first))
        end = self._make_room(int(np.count_nonzero(kept)))
        new = slice(self.count, end)
        self._rows[new], self._columns[new], self._blocks[new] = rows[kept] - first, columns[kept], blocks[kept]
        self.count = end

    def add_compiled(self, function: Callable[..., None], most: int, rows: np.ndarray, *arguments: object) -> None:
        """Adds what a compiled function finds, `most` blocks at most, for vertices in these global `rows` (n,). After
        its arguments it takes where they go.
        """
        self._make_room(most)
        space, start = self.pattern.space, self.count
        out = ffi.new("out_t *", {"first": space.first_block, "last": space.first_block + space.n_owned})
        out.rows, out.to_rows, out.to_columns = (
            pointer(numbers, "int64_t") for numbers in (rows, self._rows[start:], self._columns[start:])
        )
        out.blocks = pointer(self._blocks[start:])
        function(*arguments, out)
        self.count += out.count

    def _make_room(self, more: int) -> int:
        """Enlarges the buffers for so many more blocks; returns how many there would then be."""
        end = self.count + more
        if end > len(self._rows):
            parts = (self._rows, self._columns, self._blocks)
            buffers = tuple(np.empty((2 * end, *part.shape[1:]), dtype=part.dtype) for part in parts)
            for buffer, part in zip(buffers, parts, strict=True):
                buffer[: self.count] = part[: self.count]
            self._rows, self._columns, self._blocks = buffers
        return end

    def merged(self, fixed: np.ndarray | None = None) -> BlockCsr:
        """The sum of `cells` and `added`, on or right of the diagonal or in columns of lower ranks; valid until the
        next call.

        Parameters
        ----------
        fixed : (n,) bool, in PETSc's block order
            Vertices whose rows and columns become the identity's.
        """
        pattern, space = self.pattern, self.pattern.space
        d, n = space.dim, len(space.mesh.points)
        most = pattern.count + self.count
        if most > len(self._merged[1]):
            self._merged = room_of_rows(space.n_owned, most + self.count, d)
        starts, found, sums = self._merged
        cells = pointers((pattern.starts, pattern.columns, self.cells))
        pairs = *(pointer(numbers, "int64_t") for numbers in (self._rows, self._columns)), pointer(self._blocks)
        held = ffi.NULL if fixed is None else pointer(fixed, "uint8_t")
        count = library[d].merge_pairs(
            space.n_owned, space.first_block, n, cells, self.count, *pairs, held, pointers(self._merged)
        )
        if count < 0:
            raise MemoryError("no memory left for the sum of the Hessians")
        sums[count * d * d :][:SPARE] = 0.0
        return starts, found[:count], sums[: count * d * d].reshape(count, d, d)


def room_of_rows(rows: int, count: int, d: int) -> BlockCsr:
    """Memory for block rows with so many blocks, which are one array of numbers.

    It is kept from matrix to matrix: the first use of new memory costs more than the sum of a matrix.
    """
    return np.empty(rows + 1, np.int32), np.empty(count, np.int32), np.empty(count * d * d + SPARE)


def pointers(rows: BlockCsr) -> Any:
    """Block rows for C, `rows_t *`; the arrays must be kept."""
    starts, columns, blocks = rows
    return ffi.new("rows_t *", (*integers(starts, columns), pointer(blocks)))
