"""Barrier stiffness chosen at the start of each step, for contacts that count as one each, whatever their area.

One number holds for the whole level, and while Newton solves, so that its objective stays one function. It depends on
the step's start alone, so that resumed runs repeat. (A stiffness for each contact would make the energy jump where a
pair changes its kind, for example from edge and vertex to two vertices.) A contact's energy is kappa dhat g(s) as in
`barrier_law.py`, with kappa in N.
"""

import ipctk
import numpy as np

from pdvol.levels.space import LevelSpace
from pdvol.parallel import reduce
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.potentials.contact import barrier_law
from pdvol.potentials.potential import ContactPotential, Positions, Potential

# curvature of this barrier at a gap of dhat / 2 [kappa / dhat]: there it is made as stiff as Ando's
MIDWAY_CURVATURE = float(barrier_law.curvature(np.array(0.25), 1.0, 1.0))
# curvature of Ando's barrier (2 / 3) k (dhat - gap)^3 / dhat at a gap of dhat / 2 [k]
CUBIC_CURVATURE = 2.0


class AdaptiveStiffness:
    """The stiffness of Li et al. 2020 (supplement, section 4), by ipctk's functions.

    At the step's start it balances the other forces, within bounds. Where a solve ends with tiny gaps that have become
    smaller, it doubles, up to the upper bound.

    ipctk's classic barrier -K (gap^2 - dhat^2)^2 ln(gap^2 / dhat^2), added to the inertia without a weight, is this law
    with K dhat^3 = kappa weight.

    Parameters
    ----------
    others : terms that are no contact
    contacts : terms whose `kappa` is set
    mass : (n_owned, d) [kg]
    diagonal : of the smallest free body [m]
    """

    def __init__(
        self,
        space: LevelSpace,
        others: tuple[Potential, ...],
        contacts: tuple[ContactPotential, ...],
        mass: np.ndarray,
        dhat: float,
        diagonal: float,
    ):
        self.space, self.others, self.contacts = space, others, contacts
        self.mass, self.dhat, self.diagonal = mass, dhat, diagonal
        self._average = float(space.to_input(mass)[:, 0].mean())
        self.upper = np.inf

    def begin_step(self, x_t: Positions, x_hat: np.ndarray, weight: float) -> None:
        """Sets the stiffness for the step from x_t to x_hat (n_owned, d) of this weight [s^2]. Collective."""
        scale = self.dhat**3 / weight
        for term in self.contacts:
            term.kappa = scale
        nothing = np.zeros_like(x_t.owned)
        forces = self.mass * (x_t.owned - x_hat) + weight * sum((term.gradient(x_t) for term in self.others), nothing)
        barrier = weight * sum((term.gradient(x_t) for term in self.contacts), nothing)
        whole = [self.space.to_input(part).ravel() for part in (forces, barrier)]
        kappa, upper = ipctk.initial_barrier_stiffness(
            bbox_diagonal=self.diagonal,
            barrier=ipctk.ClampedLogBarrier(),
            dhat=self.dhat,
            average_mass=self._average,
            grad_energy=whole[0],
            grad_barrier=whole[1],
        )
        self.upper = upper * scale
        self._gap = self._smallest(x_t)
        self._set(kappa * scale)

    def end_solve(self, x: Positions) -> bool:
        """Whether the stiffness was raised after a solve that ended at x. Collective."""
        before, self._gap, old = self._gap, self._smallest(x), self.contacts[0].kappa
        self._set(
            ipctk.update_barrier_stiffness(
                prev_min_distance=before**2,
                min_distance=self._gap**2,
                max_barrier_stiffness=self.upper,
                barrier_stiffness=old,
                bbox_diagonal=self.diagonal,
            )
        )
        return self.contacts[0].kappa > old

    def _smallest(self, x: Positions) -> float:
        return min(term.min_gap(x) for term in self.contacts)

    def _set(self, kappa: float) -> None:
        for term in self.contacts:
            term.kappa = kappa


class SemiImplicitStiffness:
    """The elasticity-inclusive stiffness of Ando 2024: k = m / gap^2 + n' H n [N/m], averaged over the contacts at the
    step's start.

    m / gap^2 stands for m (1 m/s)^2 / gap^2. Of the elastic Hessian H only the diagonal blocks are taken. A contact's
    vertices have the squares of their coefficients as weights, as in ipctk's `semi_implicit_stiffness`. Without
    contacts the average is over the surface's vertices, with dhat for the gap.

    k is the stiffness of Ando's cubic barrier. kappa is such that both barriers have the same curvature at dhat / 2.

    Parameters
    ----------
    elastic : terms that are neither contact nor load
    contacts : terms whose `kappa` is set
    mass : (n_owned, d) [kg]
    """

    def __init__(
        self,
        space: LevelSpace,
        elastic: tuple[Potential, ...],
        contacts: tuple[ContactPotential, ...],
        mass: np.ndarray,
        dhat: float,
    ):
        self.space, self.elastic, self.contacts, self.dhat = space, elastic, contacts, dhat
        self._masses = space.to_input(mass)[:, 0]
        self._blocks = HessianBlocks(BlockPattern(space))
        self._surface = np.unique(space.mesh.boundary)

    def begin_step(self, x_t: Positions, x_hat: np.ndarray, weight: float) -> None:
        """Sets the contacts' stiffness for a step from x_t. Collective."""
        d = self.space.dim
        self._blocks.clear()
        for term in self.elastic:
            term.add_hessian(x_t, 1.0, self._blocks)
        mine = self._blocks.cells[self._blocks.pattern.diagonal]
        blocks = np.stack([self.space.to_input(mine[:, :, j]) for j in range(d)], axis=2)
        found = np.concatenate([term.contact_stiffness(x_t, self._masses, blocks) for term in self.contacts])
        total, count = reduce(self.space.comm, float(found.sum())), reduce(self.space.comm, len(found))
        if not count:
            at = self._surface
            total, count = (
                float(np.sum(self._masses[at] / self.dhat**2 + np.trace(blocks[at], axis1=1, axis2=2) / d)),
                len(at),
            )
        for term in self.contacts:
            term.kappa = CUBIC_CURVATURE / MIDWAY_CURVATURE * self.dhat * total / count

    def end_solve(self, x: Positions) -> bool:
        """Nothing changes within a step."""
        return False
