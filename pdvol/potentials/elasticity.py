"""Elastic terms of a scene: one `CellEnergy` per law, whatever the number of bodies and regions, and one for all
damping. Cells do not invert.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import ufl

from pdvol.forms.viscosity import kelvin_voigt, kelvin_voigt_model
from pdvol.levels.materials import CellMaterials
from pdvol.levels.space import LevelSpace
from pdvol.parallel import reduce
from pdvol.potentials.assembly.cell_energy import CellEnergy
from pdvol.potentials.assembly.native import pointer
from pdvol.potentials.potential import MIN_GAP_SHARE, Positions, Rates
from pdvol.scene import Keyed

# Share of a cell's current volume that one Newton step leaves at least: the logarithm's derivatives stay moderate.
KEEP_VOLUME = 0.1


KeyedCells = Sequence[tuple[Keyed, np.ndarray]]
"""What Young's modulus follows in time, and the cells (k,) bool of a term that do."""


def _shares(keyed: KeyedCells, count: int, time: float) -> np.ndarray:
    """(count,) Young's modulus at a time [s] as a share of that at t = 0."""
    shares = np.ones(count)
    for follows, cells in keyed:
        shares[cells] = follows(time) / follows(0.0)
    return shares


class Elastic(CellEnergy):
    """The elastic energy of all cells that follow one law. Inverted cells are not admissible, whatever the law, and
    steps are capped so that none inverts.

    Parameters
    ----------
    space, psi, parameters, cells, material : as `CellEnergy` takes them; parameters are those at t = 0
    keyed : the cells whose Young's modulus changes with time: it is that of the end of each step
    """

    def __init__(
        self,
        space: LevelSpace,
        psi: Callable,
        parameters: Mapping[str, np.ndarray],
        cells: np.ndarray,
        material: str = "",
        keyed: KeyedCells = (),
    ):
        super().__init__(space, psi, parameters, cells, material=material)
        self._keyed = keyed
        self._lame = {name: parameters[name] for name in ("mu", "lmbda")} if keyed else {}

    def set_time(self, time: float) -> None:
        """Puts Young's modulus to that of a time [s]."""
        if self._keyed:
            shares = _shares(self._keyed, len(self.cells), time)
            self.set_parameters({name: shares * values for name, values in self._lame.items()})

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self.set_time(t1)

    def _sum(self, x: Positions) -> float:
        inverted = self._library.inverted_cells(self._cells, pointer(x.local))
        return np.inf if reduce(self.space.comm, inverted) else super()._sum(x)

    def max_step(
        self, x: Positions, direction: np.ndarray, until: float | None = None, gap_share: float = MIN_GAP_SHARE
    ) -> float:
        moved = np.ascontiguousarray(self.space.with_ghosts(direction))
        return self._library.volume_step(self._cells, pointer(x.local), pointer(moved), KEEP_VOLUME)


class Damping(CellEnergy):
    """Kelvin-Voigt damping of all cells that have it, stiffness-proportional: forms/viscosity.py over one step.

    Parameters
    ----------
    mu, lmbda, damping : (k,) Lame's [Pa] and the damping [s] of the cells
    cells : (k,) indices into the space's near cells, ascending
    keyed : as `Elastic` has it
    """

    def __init__(
        self,
        space: LevelSpace,
        mu: np.ndarray,
        lmbda: np.ndarray,
        damping: np.ndarray,
        cells: np.ndarray,
        keyed: KeyedCells = (),
    ):
        d, self._keyed = space.dim, keyed
        self._mu, self._lmbda = damping * mu, damping * lmbda
        self._pairs = tuple(combinations_with_replacement(range(d), 2))
        self._hats = space.mesh.hat_gradients[space.near_cells[cells]]

        def psi(F: Any, mu: Any, lmbda: Any, **before: Any) -> Any:
            return kelvin_voigt(
                F, mu, lmbda, ufl.as_matrix([[before[_entry(*sorted((i, j)))] for j in range(d)] for i in range(d)])
            )

        def model(F: Any, v: Any, w: Any, mu: Any, lmbda: Any, **before: Any) -> Any:
            return kelvin_voigt_model(F, v, w, mu, lmbda)

        start = {_entry(i, j): np.full(len(cells), float(i == j)) for i, j in self._pairs}
        parameters = {"mu": self._mu, "lmbda": self._lmbda, **start}
        super().__init__(space, psi, parameters, cells, "damping", model=model)
        self.scale = 0.0  # differences are taken before they are squared: nothing large cancels

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self._start, self._shares = self._strain(x_t), _shares(self._keyed, len(self.cells), t1)
        self.set_rates(Rates(t1 - t0))

    def set_rates(self, rates: Rates) -> None:
        # of strains, not of positions: so a turn, whose rate is one of positions alone, is not damped
        C = rates.start(self._start, lambda e: self._strain(e.x))
        before = {_entry(i, j): C[:, i, j] for i, j in self._pairs}
        mu, lmbda = (self._shares * lame / rates.duration for lame in (self._mu, self._lmbda))
        self.set_parameters({"mu": mu, "lmbda": lmbda, **before})

    def _strain(self, x: Positions) -> np.ndarray:
        """C = F'F of the cells, (k, d, d)."""
        F = np.einsum("kia,kij->kaj", x.local[self._dofs], self._hats)
        return np.einsum("kai,kaj->kij", F, F)


def _entry(i: int, j: int) -> str:
    return f"c{i}{j}"


def elastic_terms(space: LevelSpace, materials: CellMaterials) -> tuple[CellEnergy, ...]:
    """One term per law that occurs, and one for all damping if there is any."""
    near = space.near_cells
    keyed_among = lambda rows: [(keyed, cells[rows]) for keyed, cells in materials.keyed]
    terms: list[CellEnergy] = []
    for number, (law, values) in enumerate(zip(materials.laws, materials.values, strict=True)):
        cells = np.flatnonzero(materials.law[near] == number)
        parameters = {name: v[near[cells]] for name, v in values.items()}
        terms.append(Elastic(space, law.psi, parameters, cells, law.__name__, keyed_among(near[cells])))
    if materials.damping.any():
        cells = np.flatnonzero(materials.damping[near] > 0.0)
        rows = near[cells]
        mu, lmbda = (sum(values[name][rows] for values in materials.values) for name in ("mu", "lmbda"))
        terms.append(Damping(space, mu, lmbda, materials.damping[rows], cells, keyed_among(rows)))
    return tuple(terms)
