"""The linear systems of Newton's method: the Hessian of an incremental potential, summed, assembled and solved."""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.sparse import csr_array

from pdvol.compat import PETSc
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.potentials.potential import Positions
from pdvol.scene import Solver
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.linear.coarse_space import CoarseSpace, grid_weights
from pdvol.solve.linear.petsc_methods import wants_general_matrix
from pdvol.solve.linear.solver import LinearSolver
from pdvol.solve.linear.system_matrix import SystemMatrix


class NewtonSystem:
    """The Hessian of a potential, as the matrix of a KSP whose method `LinearSolver` chooses.

    Parameters
    ----------
    supported : (n_owned,) bool
        Vertices that do not move: their rows and columns are the identity's.
    coarse_weights : as `Stepper` takes it

    Attributes
    ----------
    space, potential, supported, settings : as given
    matrix : SystemMatrix
    linear : LinearSolver
        From `use` on.
    """

    def __init__(
        self,
        potential: IncrementalPotential,
        supported: np.ndarray,
        settings: Solver,
        coarse_weights: Callable[[], csr_array | None] = lambda: None,
    ):
        self.space, self.potential, self.supported, self.settings = potential.space, potential, supported, settings
        self._watch, self._coarse_weights = potential.watch, coarse_weights
        self._blocks = HessianBlocks(BlockPattern(self.space, potential.stencils))
        self.matrix = SystemMatrix(self.space, supported, wants_general_matrix(settings))
        self.linear: LinearSolver

    def use(self, ksp: PETSc.KSP) -> None:
        """Solves with a KSP from now on."""
        dense = any(domains.smoothed for domains in self.potential.stencils)
        self.linear = LinearSolver(ksp, self.settings, self._coarse_spaces, partial(self._watch.part, "linear"), dense)

    def _coarse_spaces(self) -> list[CoarseSpace]:
        """On grids, and on a coarser level if one suits; without the grids where these have more vertices."""
        grids, own = grid_weights(self.space.mesh), self._coarse_weights()
        weights = [grids] if own is None else [own] if own.shape[1] <= grids.shape[1] else [grids, own]
        return [CoarseSpace(self.space, P, self.matrix.all_supported) for P in weights]

    def sum(self, x: Positions, projection: str) -> None:
        """Sums the Hessian at x with a projection. Collective."""
        with self._watch.part("assembly"):
            self._blocks.clear()
            self._blocks.projection = projection
            self.potential.add_hessian(x, 1.0, self._blocks)

    def stick(self, x: Positions) -> None:
        """Adds to the last sum what makes bodies stick to each other where they touch at x. Collective."""
        self.potential.add_sticking(x, 1.0, self._blocks)

    def repredict(self, x: Positions) -> None:
        """Puts the potential's present prediction into the last sum at x. Collective."""
        self.potential.renew_predicted(x, 1.0, self._blocks)

    def assemble(self) -> None:
        """Makes the last sum the matrix of the next solves. Collective."""
        with self._watch.part("linear"):
            self.matrix.assemble(self._blocks)
            self.linear.set_matrix(self.matrix)

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec, near: bool = False) -> int:
        """Solves with the last matrix, as `LinearSolver.solve`; returns the number of iterations. Collective."""
        self.linear.solve(right, solution, near)
        return int(self.linear.ksp.getIterationNumber())

    def prescribe(self, fixed: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The last sum times `values` (n_owned, d) [m] of prescribed rows, a gradient; `fixed` (n_owned,) rows become
        the identity's in the next `assemble`. Collective.
        """
        moved, product = self.space.create_vector(), self.space.create_vector()
        self.matrix.support(fixed)
        moved.setArray(values.ravel())
        with self._watch.part("linear"):
            self.matrix.assemble(self._blocks, eliminate=False)
            self.matrix.shell.mult(moved, product)
        return product.getArray().reshape(values.shape)

    def release(self) -> None:
        """Supported vertices alone are prescribed again."""
        self.matrix.support(self.supported)
