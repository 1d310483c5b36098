"""The contact barrier: the sum over contacts of their weight times the law kappa dhat g(s), g(s) = -(s - 1)^2 ln s,
s = (gap / dhat)^2 (`native/barrier.c`).

Contacts between surfaces, their weights and their Hessians are those of docs/contact.md, "What is summed over". Energy
and gradient are exact, and so is the Hessian that is not projected; projected ones leave out what is negative.

Only vertices can touch a half-space first. Their weight is their area at rest, and their gap is linear in x. Behind a
plane the energy is infinite.

Source: Li et al. 2020 (Incremental Potential Contact); Li et al. 2023 (convergent IPC).
"""

import numpy as np
from mpi4py import MPI

from pdvol.compiled import pointer
from pdvol.levels.script import Obstacle
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.candidates import Candidates, Contacts
from pdvol.potentials.contact.native import library
from pdvol.potentials.potential import LEAST_LEFT, Positions, Term


class ContactBarrier(Term):
    """Barrier between all boundary primitives nearer than dhat, obstacles included, and against planes.

    Parameters
    ----------
    candidates : Candidates
    kappa : stiffness [Pa]
    """

    name = "barrier"

    def __init__(self, candidates: Candidates, kappa: float):
        self.candidates, self.surface, self.kappa = candidates, candidates.surface, kappa
        self.space, self.dhat = self.surface.space, candidates.dhat
        self._at: Positions | None = None  # where the next was found
        self._contacts: Contacts

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """All of them."""
        return self.surface.obstacles

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self.move_obstacles(t0)

    def move_obstacles(self, time: float) -> None:
        if self.surface.move_obstacles(time):
            self._at = None

    def contacts(self, x: Positions) -> Contacts:
        """The contacts at x that touch this rank's vertices, found once per x. Collective."""
        if self._at is not x:
            self._contacts, self._at = self.candidates.contacts(self.surface.vertices(x), self.kappa), x
        return self._contacts

    def value(self, x: Positions) -> float:
        return self.space.reduce(self.contacts(x).energy)

    def gradient(self, x: Positions) -> np.ndarray:
        return self.surface.rows_of(self.contacts(x).gradient)

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        found = self.contacts(x)
        into.add_compiled(
            library.barrier_blocks,
            10 * len(found),
            self.space.dim,
            found.c,
            pointer(self.surface.vertices(x)),
            self.dhat,
            self.kappa,
            weight,
            into.projection != "none",
            pointer(self.surface.rows, "int64_t"),
        )

    def max_step(
        self, x: Positions, direction: np.ndarray, until: float | None = None, gap_share: float = LEAST_LEFT
    ) -> float:
        return self.candidates.max_step(
            self.surface.vertices(x), self.surface.vertices(x.moved(1.0, direction), at=until), gap_share
        )

    def closing(self, x: Positions, path: np.ndarray, until: float) -> set[tuple[int, int]]:
        """Pairs of objects whose gap vectors, closest points held, would be gone or turned round at the path's end. The
        same on every rank. Collective.
        """
        found = self.contacts(x)
        ends = found.gaps_of(self.surface.vertices(x.moved(1.0, path), at=until))
        meet = np.einsum("kd,kd->k", ends, found.gaps) <= 0.0
        pairs = np.stack(found.objects_in_contact(self.surface.objects))[:, meet]
        mine = {(int(one), int(other)) for one, other in np.unique(pairs, axis=1).T if one != other}
        return set().union(*self.space.comm.allgather(mine))

    def count(self, x: Positions) -> int:
        """Number of contacts at x. Collective."""
        return self.space.reduce(int(np.count_nonzero(self.contacts(x).counted)))

    def min_gap(self, x: Positions) -> float:
        """Smallest distance [m] among the contacts; inf when there are none. Collective."""
        nearest = float(np.linalg.norm(self.contacts(x).gaps, axis=1).min(initial=np.inf))
        return self.space.reduce(nearest, MPI.MIN)

    def behind_planes(self, x: Positions) -> int:
        """Number of vertices on or behind a plane, counted once for each plane. Collective."""
        found = self.contacts(x)
        return self.space.reduce(int(np.count_nonzero(~found.gaps[: found.half_spaces].any(axis=1))))
