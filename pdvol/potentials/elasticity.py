"""Elastic terms of a scene: one `CellEnergy` per law, whatever the number of bodies and regions, and one for all
damping. Cells do not invert.
"""

from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import ufl

from pdvol.forms.viscosity import kelvin_voigt
from pdvol.levels.materials import CellMaterials
from pdvol.levels.space import LevelSpace
from pdvol.parallel import reduce
from pdvol.potentials.assembly import native
from pdvol.potentials.assembly.cell_energy import CellEnergy
from pdvol.potentials.assembly.native import pointer
from pdvol.potentials.potential import MIN_GAP_SHARE, Positions

# Share of a cell's current volume that one Newton step leaves at least: the logarithm's derivatives stay moderate.
KEEP_VOLUME = 0.1


class Elastic(CellEnergy):
    """The elastic energy of all cells that follow one law. Inverted cells are not admissible, whatever the law, and
    steps are capped so that none inverts.
    """

    def value(self, x: Positions) -> float:
        inverted = self._library.inverted_cells(
            self.space.dim, self._counted, pointer(self._dofs, "int32_t"), pointer(x.local)
        )
        return np.inf if reduce(self.space.comm, inverted) else super().value(x)

    def max_step(
        self, x: Positions, direction: np.ndarray, until: float | None = None, gap_share: float = MIN_GAP_SHARE
    ) -> float:
        moved = np.ascontiguousarray(self.space.with_ghosts(direction))
        return native.library().volume_step(
            self.space.dim, self._counted, pointer(self._dofs, "int32_t"), pointer(x.local), pointer(moved), KEEP_VOLUME
        )


class Damping(CellEnergy):
    """Kelvin-Voigt damping of all cells that have it, stiffness-proportional: forms/viscosity.py over one step.

    Parameters
    ----------
    mu, lmbda, damping : (k,) Lame's [Pa] and the damping [s] of the cells
    cells : (k,) indices into the space's near cells, ascending
    """

    def __init__(self, space: LevelSpace, mu: np.ndarray, lmbda: np.ndarray, damping: np.ndarray, cells: np.ndarray):
        d = space.dim
        self._mu, self._lmbda = damping * mu, damping * lmbda
        self._pairs = tuple(combinations_with_replacement(range(d), 2))
        self._hats = space.mesh.hat_gradients[space.near_cells[cells]]

        def psi(F: Any, mu: Any, lmbda: Any, **before: Any) -> Any:
            return kelvin_voigt(
                F, mu, lmbda, ufl.as_matrix([[before[_entry(*sorted((i, j)))] for j in range(d)] for i in range(d)])
            )

        start = {_entry(i, j): np.full(len(cells), float(i == j)) for i, j in self._pairs}
        super().__init__(space, psi, {"mu": self._mu, "lmbda": self._lmbda, **start}, cells, "damping", isotropic=False)
        self.scale = 0.0  # differences are taken before they are squared: nothing large cancels

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        F = np.einsum("kia,kij->kaj", x_t.local[self._dofs], self._hats)
        C = np.einsum("kai,kaj->kij", F, F)
        before = {_entry(i, j): C[:, i, j] for i, j in self._pairs}
        self.set_parameters({"mu": self._mu / (t1 - t0), "lmbda": self._lmbda / (t1 - t0), **before})


def _entry(i: int, j: int) -> str:
    return f"c{i}{j}"


def elastic_terms(space: LevelSpace, materials: CellMaterials) -> tuple[CellEnergy, ...]:
    """One term per law that occurs, and one for all damping if there is any."""
    near = space.near_cells
    terms: list[CellEnergy] = []
    for number, (law, values) in enumerate(zip(materials.laws, materials.values, strict=True)):
        cells = np.flatnonzero(materials.law[near] == number)
        parameters = {name: v[near[cells]] for name, v in values.items()}
        terms.append(Elastic(space, law.psi, parameters, cells, material=law.__name__))
    if materials.damping.any():
        cells = np.flatnonzero(materials.damping[near] > 0.0)
        rows = near[cells]
        mu, lmbda = (sum(values[name][rows] for values in materials.values) for name in ("mu", "lmbda"))
        terms.append(Damping(space, mu, lmbda, materials.damping[rows], cells))
    return tuple(terms)
