"""Elastic terms of a scene: one `CellEnergy` per law, whatever the number of bodies; and the step that keeps cells upright."""

import numpy as np

from pdvol.hierarchy.level_space import LevelSpace
from pdvol.potentials import native
from pdvol.potentials.cell_energy import CellEnergy
from pdvol.potentials.native import pointer
from pdvol.potentials.potential import Positions
from pdvol.scene import Material

KEEP_VOLUME = 0.1  # of a cell's current volume, at least, after one Newton step: the logarithm's derivatives stay within reach


class Elastic(CellEnergy):
    """The elastic energy of all cells that follow one law; steps are capped so that no cell inverts."""

    def max_step(self, x: Positions, direction: np.ndarray, until: float | None = None) -> float:
        moved = np.ascontiguousarray(self.space.with_ghosts(direction))
        return native.library().volume_step(self.space.dim, self._counted, pointer(self._dofs, "int32_t"), pointer(x.local), pointer(moved),
                                            KEEP_VOLUME)


def elastic_terms(space: LevelSpace, materials: tuple[Material, ...]) -> tuple[Elastic, ...]:
    """One term per law that occurs; `materials` has one entry per body."""
    bodies = space.mesh.bodies[space.near_cells]
    terms = []
    for law in dict.fromkeys(type(m) for m in materials):
        chosen = [i for i, m in enumerate(materials) if type(m) is law]
        cells = np.flatnonzero(np.isin(bodies, chosen))
        mu, lmbda = (np.array([getattr(m, name) for m in materials])[bodies[cells]] for name in ("mu", "lmbda"))
        terms.append(Elastic(space, law.psi, {"mu": mu, "lmbda": lmbda}, cells))
    return tuple(terms)
