"""Muscles as terms: forms/muscles.py over the cells of each, with the tension of the end of the step."""

from typing import Any

import numpy as np

from pdvol.forms.muscles import active_fibre
from pdvol.levels.muscles import CellMuscle
from pdvol.levels.space import LevelSpace
from pdvol.parallel import reduce
from pdvol.potentials.assembly.cell_energy import CellEnergy
from pdvol.potentials.potential import Positions


class ActiveFibres(CellEnergy):
    """One muscle. Its tension is a parameter of cells: nothing is compiled again when it changes.

    Parameters
    ----------
    space : LevelSpace
    muscle : CellMuscle
    """

    def __init__(self, space: LevelSpace, muscle: CellMuscle):
        d = space.dim
        place = np.full(len(space.mesh.cells), -1)
        place[muscle.cells] = np.arange(len(muscle.cells))
        cells = np.flatnonzero(place[space.near_cells] >= 0)
        self._muscle, self._rows = muscle, place[space.near_cells[cells]]
        names = [f"fibre{axis}" for axis in range(d)]

        def psi(F: Any, tension: Any, **fibre: Any) -> Any:
            return active_fibre(F, tension, [fibre[name] for name in names])

        fibres = dict(zip(names, muscle.fibres[self._rows].T, strict=True))
        none = np.zeros(len(cells))
        super().__init__(space, psi, {"tension": none, **fibres}, cells, "muscle", isotropic=False)
        counted = float(self._volumes[: self._counted].sum())
        self.scale = muscle.muscle.strength * reduce(space.comm, counted)

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        # Every rank asks for all cells, so that a function that fails does so on all ranks.
        tension = self._muscle.muscle.tension(t1, self._muscle.places)
        self.set_parameters({"tension": tension[self._rows]})
