"""The home cell of every point of one level in another, and its barycentric coordinates there (paper 3.3.2, 3.3.3)."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from pdvol.errors import MeshError
from pdvol.geometry.level_mesh import LevelMesh, simplex_centres
from pdvol.levels.geodesic import CLOSEST, INSIDE, ISLAND, NEIGHBOUR, RAY, bind_outside
from pdvol.levels.islands import rebind_islands
from pdvol.levels.locate import containing_cells
from pdvol.levels.space import LevelSpace


@dataclass(frozen=True, eq=False)
class Binding:
    """Target points, in input order, bound to source cells. Replicated on all ranks.

    Attributes
    ----------
    cells : (n,) int64
        Input index of the home cell.
    kind : (n,) int8
        INSIDE, RAY, NEIGHBOUR, ISLAND (`islands.py`), or CLOSEST: an orphan.
    weights : (n, d + 1) float64
        Barycentric coordinates in the home cell; rows sum to one, entries of points outside are partly negative.
    """

    cells: np.ndarray
    kind: np.ndarray
    weights: np.ndarray

    def __post_init__(self) -> None:
        for array in (self.cells, self.kind, self.weights):
            array.flags.writeable = False

    def matrix(self, source: LevelMesh) -> sp.csr_matrix:
        """(n, n source points): each row holds a point's barycentric coordinates in its home cell of `source`."""
        n, corners = self.weights.shape
        indptr = np.arange(0, n * corners + 1, corners)
        columns = source.cells[self.cells].ravel()
        # A copy: sorting the columns sorts the values in place, which are the binding's.
        weights = sp.csr_matrix((self.weights.ravel(), columns, indptr), shape=(n, len(source.points)), copy=True)
        weights.sort_indices()
        return weights

    def report(self) -> dict:
        """Counts of points by `kind`, and the `largest_weight` in absolute value."""
        names = ("inside", "ray", "neighbour", "orphans", "islands")
        counts = {name: int(count) for name, count in zip(names, np.bincount(self.kind, minlength=5), strict=True)}
        return {**counts, "largest_weight": float(np.abs(self.weights).max())}


def bind(target: LevelSpace | LevelMesh, source: LevelSpace) -> Binding:
    """Bind every point of `target` to a cell of `source`, of the same body. Collective on the source's communicator.

    The levels may be given either way round. The result does not depend on the number of ranks.

    Raises
    ------
    MeshError
        When `source` lacks a body of `target`, or the dimensions differ; on all ranks, before any communication.
    """
    target = target.mesh if isinstance(target, LevelSpace) else target
    mesh = source.mesh
    _check(target, mesh)
    cells = containing_cells(target.points, target.point_bodies, source)
    # One rank computes it for all: arithmetic on two machines may differ in the last digit, and bindings with it.
    own = source.comm.rank == 0
    found = rebind_islands(target, mesh, *bind_outside(target, mesh, cells)) if own else None
    cells, kind = source.comm.bcast(found)
    return Binding(cells, kind, mesh.coordinates(cells, target.points))


def home_cells(target: LevelSpace, source: LevelSpace, binding: Binding) -> np.ndarray:
    """(m,) int64: the source cell that contains each target cell's centre; outside, of its corners' homes the one it is
    least far out of.

    `binding` is the target's points' own. Collective on the source's communicator.
    """
    fine, coarse = target.mesh, source.mesh
    centres = simplex_centres(fine.points, fine.cells)
    homes = containing_cells(centres, fine.bodies, source)
    outside = np.flatnonzero(homes < 0)
    if len(outside):
        choices = binding.cells[fine.cells[outside]]
        corners = np.repeat(centres[outside], fine.dim + 1, axis=0)
        within = coarse.coordinates(choices.ravel(), corners).min(axis=1).reshape(choices.shape)
        homes[outside] = choices[np.arange(len(outside)), within.argmax(axis=1)]
    return homes


def _check(target: LevelMesh, source: LevelMesh) -> None:
    if target.dim != source.dim:
        raise MeshError(f"cannot bind a {target.dim}D level to a {source.dim}D level")
    missing = np.setdiff1d(target.bodies, source.bodies)
    if len(missing):
        raise MeshError(
            f"body {missing[0]} has no cells on one of two neighbouring levels: give every level a mesh of every body"
        )


__all__ = ["CLOSEST", "INSIDE", "ISLAND", "NEIGHBOUR", "RAY", "Binding", "bind", "home_cells"]
