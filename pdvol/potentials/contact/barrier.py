"""The contact barrier: the sum over contacts of their weight times the law kappa dhat g(s), g(s) = -(s - 1)^2 ln s,
s = (gap / dhat)^2 (pdvol/native/barrier.c).

Contacts between surfaces, their weights and their Hessians are those of docs/contact.md, "What is summed over". Energy
and gradient are exact, and so is the Hessian that is not projected; projected ones leave out what is negative.

Only vertices can touch a half-space first. Their weight is their area at rest, and their gap is linear in x. Behind a
plane the energy is infinite.

Newton's model has no contact that is farther than dhat, and nearer ones are as stiff in it as they are now. So its
direction goes through what is in the way, and collision detection cuts it off for all bodies: again and again, until
contact has become as stiff as it has to be. Pairs that a direction brings together are therefore predicted to meet, and
the direction is solved for again, with the law's tangent at the gap that each pair is expected to have at its end. That
gap is the one at which the law has the force that the last tangent found: a primal-dual step, as that of friction.py.
Energy and gradient are not changed by a prediction.

Source: Li et al. 2020 (Incremental Potential Contact); Li et al. 2023 (convergent IPC).
"""

from collections.abc import Collection, Sequence

import numpy as np
from mpi4py import MPI

from pdvol.compiled import pointer
from pdvol.levels.script import Obstacle
from pdvol.native import library
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.candidates import MEETING, Candidates, Contacts
from pdvol.potentials.potential import LEAST_LEFT, PRESSED_GAP_SHARE, Positions, Term


class ContactBarrier(Term):
    """Barrier between all boundary primitives nearer than dhat, obstacles included, and against planes.

    Parameters
    ----------
    kappa : stiffness [Pa]
    """

    name = "barrier"

    def __init__(self, candidates: Candidates, kappa: float):
        self.candidates, self.surface, self.kappa = candidates, candidates.surface, kappa
        self.space, self.dhat = self.surface.space, candidates.dhat
        self._meetings: np.ndarray = np.empty(0, MEETING)

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """All of them."""
        return self.surface.obstacles

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self.move_obstacles(t0)

    def move_obstacles(self, time: float) -> None:
        self.surface.move_obstacles(time)

    def contacts(self, x: Positions) -> Contacts:
        """The contacts at x that touch this rank's vertices, found once per x. Collective."""
        find = lambda: self.candidates.contacts(self.surface.vertices(x), self.kappa)
        return x.get((self, "contacts"), find, self.surface.version)

    def value(self, x: Positions) -> float:
        return self.space.reduce(self.contacts(x).energy)

    def gradient(self, x: Positions) -> np.ndarray:
        return self.surface.rows_of(self.contacts(x).gradient)

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        found, places = self.contacts(x), pointer(self.surface.vertices(x))
        given = found.c, places, self.dhat, self.kappa, weight, into.projection != "none"
        self.surface.add_blocks(into, "barrier_blocks", len(found), *given)

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

    def touched(self, x: Positions, obstacles: Collection[Obstacle]) -> tuple[np.ndarray, np.ndarray]:
        """This rank's rows (k,) that touch one of some obstacles at x, and the number in `self.obstacles` (k,) of that
        one: of several, the one that pushes the row hardest.
        """
        found, bodies, first = self.contacts(x), self.surface.primitives.bodies, self.space.first_block
        chosen = np.array([False] * bodies + [obstacle in obstacles for obstacle in self.obstacles])
        objects, rows = self.surface.objects[found.vertices], self.surface.rows[found.vertices] - first
        used = found.coefficients != 0.0
        push = np.abs(found.coefficients) * (found.pressures * found.weights)[:, None]
        touching = np.where(used & chosen[objects], objects, -1).max(axis=1, initial=-1)
        mine = used & (touching >= 0)[:, None] & (objects < bodies) & (rows >= 0) & (rows < self.space.n_owned)
        if not mine.any():
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        pushes = np.zeros((self.space.n_owned, len(self.obstacles)))
        of = np.broadcast_to(touching[:, None] - bodies, mine.shape)
        np.add.at(pushes, (rows[mine], of[mine]), push[mine])
        touched = np.unique(rows[mine])
        return touched, pushes[touched].argmax(axis=1)

    def torn(self, goes_with: np.ndarray) -> np.ndarray:
        """This rank's rows (k,) in pairs predicted to meet whose vertices go with different obstacles.

        Parameters
        ----------
        goes_with : (n_owned,) int
            Number in `self.obstacles` of the one that each row goes with, -1 where it goes with none.
        """
        bodies, at = self.surface.primitives.bodies, self._meetings
        of_rows = np.repeat(goes_with[:, None].astype(float), self.space.dim, axis=1)
        with_obstacle = np.maximum(self.surface.objects - bodies, -1)
        of_bodies = self.surface.of_bodies(of_rows)[:, 0].astype(int)
        with_obstacle[: len(of_bodies)] = of_bodies
        goes = np.where(at["coefficients"] != 0.0, with_obstacle[at["vertices"]], -1)
        other = np.where(goes >= 0, goes, goes.max(axis=1, initial=-1)[:, None])
        mixed = (other != other[:, :1]).any(axis=1)
        rows = self.surface.rows[at["vertices"][mixed][goes[mixed] >= 0]] - self.space.first_block
        return np.unique(rows[(rows >= 0) & (rows < self.space.n_owned)])

    def add_sticking(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        """Adds weight times what makes contacts between bodies as stiff across their gaps as along them: they stick."""
        found = self.contacts(x)
        self.surface.add_blocks(into, "sticking_blocks", len(found), found.c, self.dhat, self.kappa, weight)

    def count(self, x: Positions) -> int:
        """Number of contacts at x. Collective."""
        return self.space.reduce(int(np.count_nonzero(self.contacts(x).counted)))

    def min_gap(self, x: Positions) -> float:
        """Smallest distance [m] among the contacts; inf when there are none. Collective."""
        return self.space.reduce(float(np.linalg.norm(self.contacts(x).gaps, axis=1).min(initial=np.inf)), MPI.MIN)

    def pinched(self, x: Positions, names: Sequence[str]) -> str:
        """The pair with the smallest gap at x, in words: the gap, the names of its objects (bodies first, then
        obstacles) and where it is; empty without contacts. Collective.
        """
        found = self.contacts(x)
        gaps, mine = np.linalg.norm(found.gaps, axis=1), (np.inf, "")
        if len(found):
            at = int(gaps.argmin())
            one, other = (int(of[at]) for of in found.objects_in_contact(self.surface.objects))
            place = self.surface.vertices(x)[found.vertices[at, 0]]
            between = f"{names[one]!r} and itself" if one == other else f"{names[one]!r} and {names[other]!r}"
            mine = float(gaps[at]), f"{gaps[at]:.2g} m between {between} at ({', '.join(f'{p:.4g}' for p in place)})"
        return min(self.space.comm.allgather(mine))[1]

    def behind_planes(self, x: Positions) -> int:
        """Number of vertices on or behind a plane, counted once for each plane. Collective."""
        found = self.contacts(x)
        return self.space.reduce(int(np.count_nonzero(~found.gaps[: found.half_spaces].any(axis=1))))

    # ---- the prediction

    def predict(self, x: Positions, end: Positions, last: bool = False, until: float | None = None) -> bool:
        """Predicts which pairs meet on the way from x to the `end` of a direction, besides those that were predicted
        for this x before, and what gaps they have there. A `last` prediction has no new pairs, for nothing would show
        whether they push. Obstacles move to their places at `until` [s] meanwhile. Returns whether anything has changed
        on this rank. Collective.
        """
        start, stop = self.surface.vertices(x), self.surface.vertices(end, at=until)
        if not self.space.reduce(self.meets, MPI.LOR):
            if self.space.reduce(self.candidates.is_clear(start, stop), MPI.LAND):
                return False
        if not last:
            found, known = self.candidates.meetings(start, stop), set(map(tuple, self._pairs))
            new = [tuple(pair) not in known for pair in found["pair"].tolist()]
            self._meetings = np.concatenate([self._meetings, found[new]])
        changed = library[self.space.dim].expect_gaps(
            *(*self._c_meetings, pointer(stop), self.dhat, self.kappa, PRESSED_GAP_SHARE)
        )
        self._meetings = self._meetings[self._meetings["expected"] > 0.0]
        return changed > 0

    @property
    def _pairs(self) -> list[list[int]]:
        return self._meetings["pair"].tolist()

    @property
    def _c_meetings(self) -> tuple:
        return len(self._meetings), pointer(self._meetings, "meeting_t")

    @property
    def meets(self) -> bool:
        """Whether any pair of this rank is predicted to meet."""
        return len(self._meetings) > 0

    @property
    def first_meeting(self) -> float:
        """Share of the way at which the first pair of this rank meets; 1 where none does."""
        return float(self._meetings["time"].min(initial=1.0))

    def forget_prediction(self) -> None:
        """No pairs meet."""
        self._meetings = self._meetings[:0]

    def predicted_change(self, x: Positions) -> np.ndarray:
        """(n_owned, d) gradient at x [N] as predicted, less the gradient as it is."""
        gradient = np.zeros(self.surface.vertices(x).shape)
        library[self.space.dim].meeting_gradient(*self._c_meetings, self.dhat, self.kappa, pointer(gradient))
        return self.surface.rows_of(gradient)

    def add_predicted(self, weight: float, into: HessianBlocks) -> None:
        """Adds weight times the Hessian as predicted, less the Hessian as it is: never negative."""
        if self.meets:
            given = *self._c_meetings, self.dhat, self.kappa, weight
            self.surface.add_blocks(into, "meeting_blocks", len(self._meetings), *given)
