"""Lumped mass and constant loads, assembled once from their UFL forms."""

import numpy as np
import ufl
from dolfinx import fem, la

from pdvol.forms.inertia import lumped_mass
from pdvol.forms.loads import body_force
from pdvol.hierarchy.level_space import LevelSpace
from pdvol.potentials.potential import Positions, Term


def density_field(space: LevelSpace, densities: np.ndarray) -> fem.Function:
    """Density [kg/m^d] as a field, from one number per cell of the level (m,)."""
    field = fem.Function(fem.functionspace(space.domain, ("DG", 0)))
    cells = space.domain_cells
    field.x.array[np.asarray(field.function_space.dofmap.list)[: len(cells), 0]] = densities[cells]
    return field


def _assemble(space: LevelSpace, form) -> np.ndarray:
    vector = fem.assemble_vector(fem.form(form))
    vector.scatter_reverse(la.InsertMode.add)
    return vector.array[: space.n_owned * space.dim].reshape(-1, space.dim).copy()


def assemble_mass(space: LevelSpace, densities: np.ndarray) -> np.ndarray:
    """Lumped masses [kg] of owned vertices, shape (n_owned, d), equal along rows. Collective."""
    v = ufl.TestFunction(space.V)
    return _assemble(space, lumped_mass(density_field(space, densities), v, space.domain))


class DeadLoad(Term):
    """A load whose force [N] does not depend on x: E = -f . x."""

    name = "load"

    def __init__(self, space: LevelSpace, force: np.ndarray):
        self.space, self.force = space, force

    def value(self, x: Positions) -> float:
        return -self.space.comm.allreduce(float(np.vdot(self.force, x.owned)))

    def gradient(self, x: Positions) -> np.ndarray:
        return -self.force


def gravity_load(space: LevelSpace, densities: np.ndarray, acceleration) -> DeadLoad:
    """The weight of all bodies under a uniform acceleration [m/s^2]. Collective."""
    v = ufl.TestFunction(space.V)
    g = fem.Constant(space.domain, np.asarray(acceleration, dtype=float))
    return DeadLoad(space, _assemble(space, body_force(density_field(space, densities), g, v, space.domain)))
