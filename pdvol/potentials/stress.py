"""Cauchy stress of stored positions, per cell, from the same energy densities that were minimised.

sigma = P F' / J with P = d psi / d F. In 2D, which is plane strain, F is completed by F_33 = 1, so the stress across
the plane is included. Cells of smoothed elements show the stress of their own F, not that of the means around edges,
from which forces come.
"""

import numpy as np
import ufl

from pdvol.potentials.assembly.cell_energy import CellEnergy
from pdvol.potentials.assembly.kernels import ONE_POINT, Kernel, tensors


class CauchyStress:
    """Stresses of one `CellEnergy` [Pa], on one rank alone: construction compiles their kernel."""

    def __init__(self, term: CellEnergy):
        self._mesh, self._term, d = term.space.mesh, term, term.space.dim
        self._mine = np.isin(np.arange(len(self._mesh.cells)), term.domains.cells)
        self._F = ufl.Coefficient(tensors((d, d)))
        self._parameters = {ufl.Coefficient(tensors()): name for name in term.parameters}
        F = ufl.variable(
            ufl.as_matrix([[self._F[i, j] if max(i, j) < d else float(i == j) for j in range(3)] for i in range(3)])
        )
        given = {name: coefficient for coefficient, name in self._parameters.items()}
        stress = ufl.diff(term.psi(F, **given), F) * F.T / ufl.det(F)
        self._kernel = Kernel(term.space.comm, ufl.inner(stress, ufl.TestFunction(tensors((3, 3)))) * ONE_POINT)

    def add_to(self, stresses: np.ndarray, positions: np.ndarray) -> None:
        """Writes the stresses (m, 3, 3) of the term's cells at positions (n, d), both in the input's order; with the
        term's parameters as they are.
        """
        cells = np.flatnonzero(self._mine)
        F = np.einsum("kia,kij->kaj", positions[self._mesh.cells[cells]], self._mesh.gradients_in(cells))
        values = {
            coefficient: self._term.parameters[name][cells, None] for coefficient, name in self._parameters.items()
        } | {self._F: F.reshape(len(cells), -1)}
        found = self._kernel.evaluate(np.hstack([values[coefficient] for coefficient in self._kernel.coefficients]))
        stresses[cells] = found.reshape(-1, 3, 3)


def von_mises(stresses: np.ndarray) -> np.ndarray:
    """(m,) [Pa]: root of 3/2 s:s, s the deviator of stresses (m, 3, 3)."""
    deviator = stresses - np.trace(stresses, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    return np.sqrt(1.5 * np.einsum("kij,kij->k", deviator, deviator))
