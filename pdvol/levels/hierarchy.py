"""The levels of a scene, coarsest first, and the prolongations between neighbours."""

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_array

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.binding import Binding, bind, home_cells
from pdvol.levels.prolongation import Prolongation, input_weights
from pdvol.levels.space import LevelSpace
from pdvol.registry import INTERPOLANTS
from pdvol.stages import stage

# vertices: every rank solves the coarse system directly in every iteration
MAX_COARSE_VERTICES = 4000
# weights per fine vertex, on average: the coarse operator's cost grows with their square
MAX_WEIGHTS = 30
# ratio of a level's vertices to the coarse ones: with 6, linear systems of a heap took 2.4 times as long
MIN_COARSENING = 20


class Hierarchy:
    """The `LevelSpace` of each level: `hierarchy[0]` is the coarsest, `hierarchy[-1]` the finest. Each is made when it
    is first needed, which is collective.

    Parameters
    ----------
    level_meshes : coarsest first; at least one
    interpolant : a name in `pdvol.registry.INTERPOLANTS`
    places : (n, d) [m]
        Positions of the finest level by which it is divided among the ranks.

    Attributes
    ----------
    meshes : tuple of LevelMesh, as given

    Raises
    ------
    ValueError, InputError
        No level; an unknown interpolant.
    """

    def __init__(
        self,
        level_meshes: Sequence[LevelMesh],
        comm: MPI.Comm,
        interpolant: str = "barycentric",
        places: np.ndarray | None = None,
    ):
        if len(level_meshes) == 0:
            raise ValueError("a hierarchy needs at least one level")
        INTERPOLANTS.check(interpolant)
        self.meshes, self.comm, self.interpolant, self._places = tuple(level_meshes), comm, interpolant, places
        self._spaces: dict[int, LevelSpace] = {}
        self._bindings: dict[int, Binding] = {}
        self._prolongations: dict[int, Prolongation] = {}

    def __len__(self) -> int:
        return len(self.meshes)

    def __getitem__(self, level: int) -> LevelSpace:
        level = range(len(self))[level]
        if level not in self._spaces:
            places = self._places if level == len(self) - 1 else None
            self._spaces[level] = LevelSpace(self.meshes[level], self.comm, places)
        return self._spaces[level]

    def prolongation(self, level: int) -> Prolongation:
        """From `level - 1` to `level`, built at the first call, which is collective.

        Raises
        ------
        ValueError
            When `level` is not one of 1 ... len - 1.
        """
        if not 1 <= level < len(self):
            raise ValueError(
                f"no prolongation leads to level {level}; levels with a coarser neighbour: 1 to {len(self) - 1}"
            )
        if level not in self._prolongations:
            with stage(f"binding level {level} to level {level - 1}"):
                self._prolongations[level] = Prolongation(
                    self[level - 1], self[level], self._binding(level), INTERPOLANTS[self.interpolant]
                )
        return self._prolongations[level]

    def prolong(self, values: np.ndarray, coarse: int, fine: int) -> np.ndarray:
        """Positions or velocities (n_fine, d) of a level from those (n_coarse, d) of a coarser one, through all levels
        between; the same ones where both are one level. All in input order and on every rank. Collective.
        """
        for level in range(coarse + 1, fine + 1):
            values = self.prolongation(level).prolong(values)
        return values

    def _binding(self, level: int) -> Binding:
        if level not in self._bindings:
            self._bindings[level] = bind(self[level], self[level - 1])
        return self._bindings[level]

    def origins(self, level: int) -> np.ndarray:
        """(m,) int64: the coarsest level's cell that each cell of a level inherits from, through its home on every
        level between. Collective.
        """
        cells = np.arange(len(self.meshes[level].cells))
        for k in range(level, 0, -1):
            cells = home_cells(self[k], self[k - 1], self._binding(k))[cells]
        return cells

    def coarse_weights(self, level: int) -> csr_array | None:
        """Weights (n, m) of a level over the coarser level that suits a two-level preconditioner best; None where none
        does. Collective.

        That is the finest level with at most `MAX_COARSE_VERTICES` vertices and at least `MIN_COARSENING` times fewer
        than the level itself, if the weights have at most `MAX_WEIGHTS` entries per row.
        """
        sizes = [len(mesh.points) for mesh in self.meshes]
        fitting = [k for k in range(level) if sizes[k] <= min(MAX_COARSE_VERTICES, sizes[level] / MIN_COARSENING)]
        if not fitting:
            return None
        matrix = self.prolongation(level).matrix
        for between in range(level - 1, fitting[-1], -1):
            matrix = matrix.matMult(self.prolongation(between).matrix)
        weights = input_weights(matrix, self[fitting[-1]], self[level])
        weights.eliminate_zeros()
        return weights if weights.nnz <= MAX_WEIGHTS * weights.shape[0] else None
