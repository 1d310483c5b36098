"""The function that a time step minimises: 1/2 |x - x_hat|^2_M + weight times the sum of terms (docs/method.md)."""

from collections.abc import Collection, Mapping, Sequence
from itertools import groupby
from math import isfinite, isnan

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_array

from pdvol.errors import SimulationError
from pdvol.levels.script import Obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.domains import Domains
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.build import Terms
from pdvol.potentials.potential import LEAST_LEFT, Positions, Rates, Term, by_names
from pdvol.solve.report import Stopwatch

TINY = float(np.finfo(float).tiny)  # stands for a force of zero in a quotient


def is_finite(values: np.ndarray) -> bool:
    """Whether all values are finite; the sum of their squares shows it sooner than each of them."""
    return isfinite(np.vdot(values, values)) or bool(np.isfinite(values).all())


class IncrementalPotential:
    """Inertia and the weighted sum of a level's terms [kg m^2].

    Attributes
    ----------
    mass : (n_owned, d) [kg]
    contacts, frictions : the barriers; the potentials of friction
    x_hat : (n_owned, d) predicted positions [m]
    weight : of the terms beside the inertia [s^2], as the integrator gives it
    """

    def __init__(self, space: LevelSpace, terms: Terms, watch: Stopwatch, bodies: Sequence[str] = ()):
        self.space, self.watch, self.mass, self._bodies = space, watch, terms.mass, bodies
        self.contacts, self.frictions = terms.contacts, terms.frictions
        self.terms = terms.potentials
        self.x_hat, self.weight = np.zeros((0, space.dim)), 0.0
        self._gradient: np.ndarray = np.zeros(0)  # where it was found last [kg m]
        self._gradients: list[np.ndarray] = []  # those of inertia and terms there

    @property
    def terms(self) -> tuple[Term, ...]:
        """All potentials."""
        return self._terms

    @terms.setter
    def terms(self, terms: tuple[Term, ...]) -> None:
        in_contact = {id(term) for term in (*self.contacts, *self.frictions)}
        part_of = lambda term: "contact" if id(term) in in_contact else "assembly"
        self._terms = terms
        # neighbours that are timed as one part
        self._parts = tuple((self.watch.part(part), tuple(same)) for part, same in groupby(terms, part_of))

    def begin_step(
        self, x_t: Positions, x_hat: np.ndarray, weight: float, t0: float, t1: float, rates: Rates | None = None
    ) -> None:
        """Starts the step from t0 to t1 [s] at x_t with predicted positions x_hat (n_owned, d); rates are means over
        the step where not given.
        """
        self.x_hat, self.weight = x_hat, weight
        expected = Positions(self.space, x_hat)
        for part, terms in self._parts:
            with part:
                for term in terms:
                    term.begin_step(x_t, t0, t1, expected)
                    if rates is not None:
                        term.set_rates(rates)

    def _require_finite(self, term_name: str, what: str, values: np.ndarray | float, rows: np.ndarray) -> None:
        """Raises SimulationError unless the values of all ranks are finite, naming the term, and the first body whose
        `rows` (n_owned, d) are not. Collective.
        """
        bad = 0 if np.isfinite(values).all() else 2 if np.isnan(values).any() else 1
        how = ("", "infinite", "not a number")[self.space.reduce(bad, MPI.MAX)]
        if how:
            found = self.space.mesh.point_bodies[self.space.owned_points[~np.isfinite(rows).all(axis=1)]]
            first = self.space.reduce(int(min(found, default=len(self._bodies))), MPI.MIN)
            where = "".join(f" in body {name!r}" for name in self._bodies[first : first + 1])
            raise SimulationError(f"the {term_name} term's {what} is {how}{where}")

    def inertia(self, x: Positions) -> float:
        """1/2 |x - x_hat|^2_M [kg m^2]."""
        off = x.owned - self.x_hat
        return 0.5 * self.space.reduce(float(np.vdot(off, self.mass * off)))

    def value(self, x: Positions) -> float:
        """The potential at x; inf where x is not admissible or a term is not a number there."""
        total = self.inertia(x)
        for part, terms in self._parts:
            with part:
                for term in terms:
                    total += self.weight * term.value(x)
        return np.inf if isnan(total) else total

    def require_admissible(self, x: Positions) -> None:
        """Raises SimulationError, naming the term, where one has no finite energy at a solve's start x. Collective."""
        self._require_finite("inertia", "energy", self.inertia(x), x.owned - self.x_hat)
        for term in self.terms:
            self._require_finite(term.name, "energy", term.value(x), term.gradient(x))

    def gradient(self, x: Positions) -> np.ndarray:
        """Gradient rows (n_owned, d). Raises SimulationError, naming the term, where one is not finite."""
        found = [self.mass * (x.owned - self.x_hat)]
        for part, terms in self._parts:
            with part:
                found += [self.weight * term.gradient(x) for term in terms]
        self._gradients, total = found, found[0]
        for rows in found[1:]:
            total = total + rows
        if not self.space.reduce(is_finite(total), MPI.LAND):
            for name, rows in zip(("inertia", *(term.name for term in self.terms)), found, strict=True):
                self._require_finite(name, "gradient", rows, rows)
            raise SimulationError("the gradient is too large for double precision")
        self._gradient = total
        return total.copy()

    def imbalance(self, bodies: csr_array, least: float) -> float:
        """What is left of the gradient over the largest part that one kind of term has in it: of all vertices of a
        body, and of the body's sum, whichever is worse, and of all bodies the worst. `bodies` (bodies, n_owned) is that
        of `rows_of_bodies` without supported vertices. Where all parts are smaller, those that move a vertex or a body
        by `least` [m] take their place. At the last `gradient`. Collective.
        """
        kinds: dict[str, np.ndarray] = {}
        for name, part in zip(("inertia", *(term.name for term in self.terms)), self._gradients, strict=True):
            kinds[name] = kinds[name] + part if name in kinds else part
        parts = np.stack([self._gradient, *kinds.values(), least / np.sqrt(self.space.dim) * self.mass], axis=1)
        filled = np.diff(bodies.indptr) > 0
        most = np.zeros((len(filled), parts.shape[1]))  # squares
        squares, firsts = np.einsum("nkd,nkd->nk", parts, parts), bodies.indptr[:-1][filled]
        most[filled] = np.maximum.reduceat(squares[bodies.indices], firsts)
        sums = self.space.reduce((bodies @ parts.reshape(len(parts), -1)).reshape(*most.shape, -1))
        sizes = np.sqrt([self.space.reduce(most, MPI.MAX), np.einsum("bkd,bkd->bk", sums, sums)])
        return float(np.max(sizes[:, :, 0] / np.maximum(sizes[:, :, 1:].max(axis=2), TINY)))

    def rows_of_bodies(self, chosen: np.ndarray | None = None) -> csr_array:
        """(bodies, n_owned): one where this rank's row, of the `chosen` (n_owned,), is of a body."""
        of = self.space.mesh.point_bodies
        rows = np.arange(self.space.n_owned) if chosen is None else np.flatnonzero(chosen)
        entries = np.ones(len(rows)), (of[self.space.owned_points[rows]], rows)
        return csr_array(entries, shape=(int(of.max()) + 1, self.space.n_owned))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        """Adds weight times the Hessian, positive definite unless `into.projection` is "none", to blocks that are zero.

        Raises SimulationError, naming the term, where one is not finite. Collective.
        """
        into.add_masses(weight * self.mass)
        for part, terms in self._parts:
            with part:
                for term in terms:
                    if term not in self.frictions:
                        term.add_hessian(x, weight * self.weight, into)
        into.keep_added()
        self.renew_predicted(x, weight, into)
        if not self.space.reduce(into.finite(), MPI.LAND):
            self._name_hessian(x, weight, into)

    def renew_predicted(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        """Replaces friction and predicted contact in the last `add_hessian`'s blocks by the present prediction."""
        into.drop_later()
        with self.watch.part("contact"):
            for term in self.frictions:
                term.add_hessian(x, weight * self.weight, into)
            for contact in self.contacts:
                contact.add_predicted(weight * self.weight, into)

    def _name_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        """Raises for the first term whose Hessian is not finite, found by evaluating each alone."""
        for term in self.terms:
            into.clear()
            term.add_hessian(x, weight * self.weight, into)
            rows = np.bincount(into.pattern.rows, into.cells.sum(axis=(1, 2)), self.space.n_owned)[:, None]
            self._require_finite(term.name, "Hessian", np.array([rows.sum(), np.sum(into.added[2])]), rows)
        raise SimulationError("the Hessian is too large for double precision")

    def max_step(
        self, x: Positions, direction: np.ndarray, until: float | None = None, gap_share: float = LEAST_LEFT
    ) -> float:
        """Largest admissible step in [0, 1] along direction, obstacles moving to `until` [s] meanwhile: the same on
        every rank.

        Where contact ends it, `gap_share` of a gap is left.
        """
        with self.watch.part("ccd"):
            steps = np.array([1.0, *(term.max_step(x, direction, until, gap_share) for term in self.terms)])
            lost = np.flatnonzero(np.isnan(steps))
            largest = self.space.reduce(float(-lost[0] if len(lost) else steps.min()), MPI.MIN)
        if largest < 0.0:
            raise SimulationError(f"the {self.terms[int(-largest) - 1].name} term's largest step is not a number")
        return largest

    def min_gap(self, x: Positions) -> float:
        """Smallest gap [m] of all contact terms at x; inf where there is none. Collective."""
        with self.watch.part("contact"):
            return min((term.min_gap(x) for term in self.contacts), default=np.inf)

    @property
    def stencils(self) -> tuple[Domains, ...]:
        """Of all terms."""
        return tuple(domains for term in self.terms for domains in term.stencils)

    @property
    def scale(self) -> float:
        """Size [kg m^2] of the terms that cancel in the energy: its round-off is relative to it."""
        return self.weight * sum(term.scale for term in self.terms)

    def update_lag(self, x: Positions) -> float:
        """Lags friction at x. Returns the relative change of the friction forces at x, their residual. Collective."""
        with self.watch.part("contact"):
            before = [term.gradient(x) for term in self.frictions]
            for term in self.terms:
                term.update_lag(x)
            after = [term.gradient(x) for term in self.frictions]
            size = lambda forces: np.sqrt(self.space.reduce(float(np.vdot(forces, forces))))
            change, force = size(np.subtract(sum(after), sum(before))), max(size(sum(before)), size(sum(after)))
        return float(change / force) if force > 0.0 else 0.0

    def end_step(self, x: Positions) -> None:
        """Ends a step at x. Collective."""
        for term in self.terms:
            term.end_step(x)

    @property
    def memory(self) -> dict[str, dict]:
        """What the next step needs to know of those before, by the terms' names; without those that need nothing."""
        return {name: dict(term.memory) for name, term in by_names(self.terms).items() if term.memory}

    def restore(self, memory: Mapping[str, Mapping]) -> None:
        """Sets what `memory` gave."""
        for name, term in by_names(self.terms).items():
            term.restore(memory.get(name, {}))

    def predict(
        self, x: Positions, direction: np.ndarray, first: bool, last: bool, until: float | None = None
    ) -> np.ndarray | None:
        """Predicts, in the `first` prediction at x, which contacts that slide stick at the end of a direction
        (n_owned, d) and, where that changes nothing, which pairs meet on the way there; in the `last` one no new ones.
        Obstacles move to their places at `until` [s] meanwhile. Returns the gradient (n_owned, d) at x as predicted
        less the gradient as it is; None where nothing has changed. Collective.
        """
        with self.watch.part("contact"):
            end = x.moved(1.0, direction)
            # all of them, for the calls are collective
            changed = [term.predict(x, end) for term in self.frictions] if first else []
            if not self.space.reduce(any(changed), MPI.LOR):
                changed = [term.predict(x, end, last, until) for term in self.contacts]
                if not self.space.reduce(any(changed), MPI.LOR):
                    return None
            changes = [term.predicted_change(x) for term in self.contacts]
            changes += [term.predicted_change(x) for term in self.frictions]
            return self.weight * sum(changes, np.zeros_like(x.owned))

    def forget_prediction(self) -> None:
        """All contacts slide or stick as they do, and nothing meets."""
        for contact in self.contacts:
            contact.forget_prediction()
        for friction in self.frictions:
            friction.forget_prediction()

    @property
    def first_meeting(self) -> float:
        """Share of the first direction at which a pair predicted to meet does; 1 where there is none. Collective."""
        return self.space.reduce(min((term.first_meeting for term in self.contacts), default=1.0), MPI.MIN)

    @property
    def has_friction(self) -> bool:
        """Whether friction acts anywhere, as lagged. Collective."""
        return self.space.reduce(any(term.has_friction for term in self.terms), MPI.LOR)

    def move_obstacles(self, time: float) -> None:
        """Puts obstacles where they are at `time` [s]."""
        for term in self.terms:
            term.move_obstacles(time)

    def closing(self, x: Positions, path: np.ndarray, until: float) -> list[tuple[int | Obstacle, int | Obstacle]]:
        """The pairs of bodies (by number) and obstacles in contact at x that would meet on the straight way along path
        (n_owned, d), to first order, while obstacles move to their places at `until` [s]. Collective.
        """
        bodies, found = range(int(self.space.mesh.point_bodies.max()) + 1), []
        for term in self.contacts:
            objects = (*bodies, *term.obstacles)
            with self.watch.part("contact"):
                found += [(objects[one], objects[other]) for one, other in sorted(term.closing(x, path, until))]
        return found

    def touched(self, x: Positions, obstacles: Collection[Obstacle]) -> dict[Obstacle, np.ndarray]:
        """This rank's rows that touch each of some obstacles at x; a row that touches several is with the one that
        pushes it hardest.
        """
        found: dict[Obstacle, np.ndarray] = {}
        for term in self.contacts:
            with self.watch.part("contact"):
                rows, numbers = term.touched(x, obstacles)
            found |= {term.obstacles[number]: rows[numbers == number] for number in np.unique(numbers)}
        return found

    def torn(self, along: Mapping[Obstacle, np.ndarray]) -> np.ndarray:
        """(n_owned,) bool: rows that go along with obstacles, of pairs predicted to meet whose vertices go with
        different ones. Collective.
        """
        torn = np.zeros(self.space.n_owned, dtype=bool)
        for term in self.contacts:
            goes_with = np.full(self.space.n_owned, -1)
            for obstacle, rows in along.items():
                goes_with[rows] = term.obstacles.index(obstacle)
            torn[term.torn(goes_with)] = True
        return torn

    def add_sticking(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        """Adds to the last `add_hessian` what makes bodies stick to each other where they touch at x."""
        into.drop_later()
        with self.watch.part("contact"):
            for contact in self.contacts:
                contact.add_sticking(x, weight * self.weight, into)
        into.keep_added()
        self.renew_predicted(x, weight, into)

    def energies(self, x: Positions) -> dict[str, float]:
        """Energy by kind [J]: inertia is the potential's first part over dt^2."""
        energy = dict.fromkeys(("inertia", "elastic", "load", "barrier", "friction", "consistency"), 0.0)
        energy["inertia"] = self.inertia(x) / self.weight
        for part, terms in self._parts:
            with part:
                for term in terms:
                    energy[term.name] = energy.get(term.name, 0.0) + term.value(x)
        return energy

    def forces(self, x: Positions) -> dict[str, np.ndarray]:
        """Forces (n, d) [N] by kind, in the input's order of vertices: minus the gradients of the energies. Where the
        step ends, they sum to zero but for what supports push, and for Newton's residual. Collective.
        """
        force = {"inertia": -self.mass * (x.owned - self.x_hat) / self.weight}
        for part, terms in self._parts:
            with part:
                for term in terms:
                    force[term.name] = force.get(term.name, 0.0) - term.gradient(x)
        return {name: self.space.to_input(rows) for name, rows in force.items()}
