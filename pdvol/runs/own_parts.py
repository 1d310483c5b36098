"""Followed parts of the motions of obstacles for a user's own energy, as a scene's march takes them
(`integrate/scripted_motion.py`): what `pdvol.Contact.follow` does.
"""

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_array

from pdvol.compat import PETSc
from pdvol.errors import InputError
from pdvol.integrate.scripted_motion import MotionParts, ScriptedMotion
from pdvol.levels.script import HeldPoints, Script
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.build import Terms
from pdvol.potentials.potential import Positions, Term
from pdvol.scene import Motion, Solver, Still
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.newton import Newton
from pdvol.solve.newton_system import NewtonSystem
from pdvol.solve.report import Stopwatch


class GivenEnergy(Term):
    """An energy of which the gradient and the Hessian at one state are known, which is all that a direction needs."""

    name = "user's own"

    def __init__(self, space: LevelSpace, gradient: np.ndarray, hessian: PETSc.Mat):
        size = len(space.mesh.points) * space.dim
        if not isinstance(hessian, PETSc.Mat) or hessian.getSize() != (size, size) or not hessian.assembled:
            raise InputError(f"follow: the Hessian is an assembled PETSc matrix of {size} rows and columns")
        self._gradient = gradient
        starts, columns, values = hessian.getValuesCSR()
        rows = csr_array((values, columns, starts), shape=(space.n_owned * space.dim, size))
        blocks = rows.tobsr((space.dim, space.dim))
        self._rows = space.first_block + np.repeat(np.arange(space.n_owned), np.diff(blocks.indptr))
        self._columns, self._blocks = blocks.indices.astype(np.int64), blocks.data

    def value(self, x: Positions) -> float:
        return np.nan  # unknown

    def gradient(self, x: Positions) -> np.ndarray:
        return self._gradient

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        into.add_pairs(self._rows, self._columns, weight * self._blocks)


def held_points(x: Positions, rows: np.ndarray, to: np.ndarray | None, t0: float, t1: float) -> tuple[HeldPoints, ...]:
    """The support of held vertices, none where no rank has any. Collective.

    Parameters
    ----------
    x : where they are at t0 [s]
    rows : (n_owned,) bool
    to : (n_owned, d) [m]
        Where they are at t1 [s], on a straight way; where None they stay.
    """
    mask = x.space.to_input(rows[:, None])[:, 0] > 0.0
    start: np.ndarray = x.whole[mask]
    motion: Motion = Still()
    if to is not None:
        way = x.space.to_input(to)[mask] - start
        motion = lambda X, t: X + (t - t0) / (t1 - t0) * way
    return (HeldPoints(mask, start, motion, np.inf),) if mask.any() else ()


def longest_part(
    x: Positions, energy: GivenEnergy, terms: Terms, script: Script, t0: float, t1: float, least: float
) -> tuple[float, Positions | None]:
    """The longest followed part from x, where obstacles are at t0, towards t1 [s], as a scene's march takes it.

    Parameters
    ----------
    energy : without contact, at x
    terms : of contact, which have begun the step
    script : of held vertices and obstacles
    least : [s] that a part gains at least

    Returns
    -------
    until : when it ends [s]
    end : where; None where it gains too little: bodies must give way before
    """
    motion = ScriptedMotion(x.space, script, x.whole, t1 - t0)
    motion.begin(t0)
    all_terms = Terms(terms.mass, (energy, *terms.potentials), terms.contacts, terms.frictions)
    potential = IncrementalPotential(x.space, all_terms, Stopwatch())
    potential.x_hat, potential.weight = x.owned, 1.0
    newton = Newton(NewtonSystem(potential, motion.held, Solver(tolerance=1.0, linear="direct")))
    return MotionParts(motion, potential, newton, lambda report: None).longest_part(x, least, 0.0)


def owned_rows(space: LevelSpace, blocks: np.ndarray | None) -> np.ndarray:
    """(n_owned,) bool: which of this rank's vertices are among block numbers of V, ghosts included. Collective."""
    rows, local = np.zeros(space.n_owned, dtype=bool), space.V.dofmap.index_map
    given = np.zeros(0, int) if blocks is None else np.asarray(blocks)
    end = local.size_local + local.num_ghosts
    fits = given.ndim == 1 and given.dtype.kind in "iu" and bool(np.all((given >= 0) & (given < end)))
    if not space.reduce(fits, MPI.LAND):
        raise InputError(f"follow: held has block numbers 0 to {end - 1} of V, by dolfinx.fem.locate_dofs_topological")
    rows[given[given < space.n_owned]] = True
    return rows
