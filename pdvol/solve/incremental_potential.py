"""The function that a time step minimises: 1/2 |x - x_hat|^2_M + dt^2 sum of terms (design, section 2)."""

import numpy as np
from mpi4py import MPI

from pdvol.errors import SimulationError
from pdvol.hierarchy.level_space import LevelSpace
from pdvol.potentials.build import Terms
from pdvol.potentials.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions
from pdvol.solve.timing import Stopwatch


class IncrementalPotential:
    """Inertia and the weighted sum of a level's terms [kg m^2].

    Attributes
    ----------
    x_hat : (n_owned, d) predicted positions [m]
    dt : time step [s]
    """

    def __init__(self, space: LevelSpace, terms: Terms, watch: Stopwatch):
        self.space, self.mass, self.terms, self.contacts, self.watch = space, terms.mass, terms.potentials, terms.contacts, watch
        self._contact_names = {id(t) for t in terms.contacts} | {id(t) for t in terms.potentials if t.name == "friction"}
        self.x_hat, self.dt = None, None

    def begin_step(self, x_t: Positions, x_hat: np.ndarray, t0: float, t1: float) -> None:
        """Starts the step from t0 to t1 [s] at x_t with predicted positions x_hat (n_owned, d)."""
        self.x_hat, self.dt = x_hat, t1 - t0
        for term in self.terms:
            with self._part(term):
                term.begin_step(x_t, t0, t1)

    def _part(self, term):
        return self.watch.part("contact" if id(term) in self._contact_names else "assembly")

    def _check(self, term_name: str, finite: bool) -> None:
        if not self.space.comm.allreduce(bool(finite), op=MPI.LAND):
            raise SimulationError(f"the {term_name} term gave NaN or infinity")

    def inertia(self, x: Positions) -> float:
        """1/2 |x - x_hat|^2_M [kg m^2]."""
        return 0.5 * self.space.comm.allreduce(float(np.vdot(x.owned - self.x_hat, self.mass * (x.owned - self.x_hat))))

    def value(self, x: Positions) -> float:
        """The potential at x; inf where x is not admissible."""
        total = self.inertia(x)
        for term in self.terms:
            with self._part(term):
                total += self.dt**2 * term.value(x)
        return total if not np.isnan(total) else np.inf

    def gradient(self, x: Positions) -> np.ndarray:
        """Gradient rows (n_owned, d). Raises SimulationError, naming the term, where one is not finite."""
        total = self.mass * (x.owned - self.x_hat)
        self._check("inertia", np.isfinite(total).all())
        for term in self.terms:
            with self._part(term):
                part = term.gradient(x)
            self._check(term.name, np.isfinite(part).all())
            total = total + self.dt**2 * part
        return total

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        """Adds weight times the Hessian, positive definite unless `into.positive` is "none"."""
        into.add_masses(weight * self.mass)
        for term in self.terms:
            with self._part(term):
                term.add_hessian(x, weight * self.dt**2, into)

    def max_step(self, x: Positions, direction: np.ndarray, until: float | None = None) -> float:
        """Largest admissible step in [0, 1] along direction, obstacles moving to `until` [s] meanwhile: the same on every rank."""
        with self.watch.part("ccd"):
            mine = min([1.0, *(term.max_step(x, direction, until) for term in self.terms)])
            return self.space.comm.allreduce(mine, op=MPI.MIN)

    @property
    def scale(self) -> float:
        """Size [kg m^2] of the terms that cancel in the energy: what its round-off is relative to."""
        return self.dt**2 * sum(term.scale for term in self.terms)

    def lag(self, x: Positions) -> None:
        """Freezes lagged quantities at x."""
        for term in self.terms:
            with self._part(term):
                term.lag(x)

    @property
    def rubs(self) -> bool:
        """Whether friction acts anywhere, as lagged. Collective."""
        return self.space.comm.allreduce(any(term.rubs for term in self.terms), op=MPI.LOR)

    def place(self, time: float) -> None:
        """Puts obstacles where they are at `time` [s]."""
        for term in self.terms:
            term.place(time)

    def energies(self, x: Positions) -> dict[str, float]:
        """Energy by kind [J]: inertia is the potential's first part over dt^2."""
        energy = dict.fromkeys(("inertia", "elastic", "load", "barrier", "friction", "consistency"), 0.0)
        energy["inertia"] = self.inertia(x) / self.dt**2
        for term in self.terms:
            with self._part(term):
                energy[term.name] = energy.get(term.name, 0.0) + term.value(x)
        return energy
