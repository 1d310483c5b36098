"""Muscles as terms: forms/muscles.py over the cells of each, with the tension of the end of the step."""

from typing import Any

import numpy as np

from pdvol.forms.muscles import active_fibres
from pdvol.levels.materials import CellMuscle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.cell_energy import CellEnergy, Density, entries_of, matrix_of
from pdvol.potentials.assembly.domains import Domains
from pdvol.potentials.potential import Positions


class ActiveFibres(CellEnergy):
    """One muscle. Its tension is a parameter of cells: nothing is compiled again when it changes.

    Parameters
    ----------
    smoothing : (m,) int, optional
        As `Domains` takes it.
    """

    def __init__(self, space: LevelSpace, muscle: CellMuscle, smoothing: np.ndarray | None = None):
        d, m = space.dim, len(space.mesh.cells)
        self._muscle, self._shape = muscle, (m, d, d)

        def psi(F: Any, **tension: Any) -> Any:
            return active_fibres(F, matrix_of("tension", tension, d))

        domains = Domains(space, np.isin(np.arange(m), muscle.cells), smoothing)
        law, none = Density(psi, isotropic=False), self._tensions(np.zeros(len(muscle.cells)))
        super().__init__(space, law, none, domains, "muscle")
        counted = float(domains.volumes[: domains.counted].sum())
        self.scale = muscle.muscle.strength * space.reduce(counted)

    def _tensions(self, tension: np.ndarray) -> dict[str, np.ndarray]:
        """The entries (m,) of tension f f' [Pa] for a tension (k,) of the muscle's cells."""
        fibres, found = self._muscle.fibres, np.zeros(self._shape)
        found[self._muscle.cells] = (tension[:, None] * fibres)[:, :, None] * fibres[:, None, :]
        return entries_of("tension", found)

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        # Every rank asks for all cells, so that a function that fails does so on all ranks.
        tension = self._muscle.muscle.tension(t1, self._muscle.places)
        self.set_parameters(self._tensions(tension))
