"""Cauchy stress of stored positions, per cell, from the same energy densities that were minimised.

sigma = P F' / J with P = d psi / d F. In 2D, which is plane strain, F is completed by F_33 = 1, so the stress across
the plane is included. Cells of smoothed elements show the stress of their own F, not that of the means around edges,
from which forces come.
"""

import numpy as np
import ufl

from pdvol.compat import fem
from pdvol.compiled import FLAGS
from pdvol.forms.kinematics import deformation_gradient
from pdvol.potentials.assembly.cell_energy import CellEnergy
from pdvol.potentials.assembly.compiled_forms import form_cache


class CauchyStress:
    """Stresses of one `CellEnergy` [Pa], on one rank alone: construction compiles its expression."""

    def __init__(self, term: CellEnergy):
        self.space, self._term = term.space, term
        self._mine = np.isin(np.arange(len(self.space.mesh.cells)), term.domains.cells)
        domain, V = self.space.domain, self.space.V
        self._x = fem.Function(V)
        constant = fem.functionspace(domain, ("DG", 0))
        self._parameters = {name: fem.Function(constant) for name in term.parameters}
        F = deformation_gradient(self._x)
        d = self.space.dim
        F = ufl.variable(
            ufl.as_matrix([[F[i, j] if max(i, j) < d else float(i == j) for j in range(3)] for i in range(3)])
        )
        stress = ufl.diff(term.psi(F, **self._parameters), F) * F.T / ufl.det(F)
        middle = np.full((1, d), 1.0 / (d + 1))
        with form_cache(self.space.comm, (stress, middle), FLAGS) as options:
            self._expression = fem.Expression(stress, middle, jit_options=options)

    def add_to(self, stresses: np.ndarray, positions: np.ndarray) -> None:
        """Writes the stresses (m, 3, 3) of the term's cells at positions (n, d), both in the input's order; with the
        term's parameters as they are.
        """
        for name, values in self._term.parameters.items():
            self._parameters[name].x.array[:] = np.where(self._mine, values, 1.0)[self.space.domain_cells]
        self._x.x.array[:] = self.space.from_input(positions).ravel()
        local = np.arange(len(self.space.mesh.cells), dtype=np.int32)
        found = np.empty_like(stresses)
        found[self.space.domain_cells] = self._expression.eval(self.space.domain, local).reshape(-1, 3, 3)
        stresses[self._mine] = found[self._mine]


def von_mises(stresses: np.ndarray) -> np.ndarray:
    """(m,) [Pa]: root of 3/2 s:s, s the deviator of stresses (m, 3, 3)."""
    deviator = stresses - np.trace(stresses, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    return np.sqrt(1.5 * np.einsum("kij,kij->k", deviator, deviator))
