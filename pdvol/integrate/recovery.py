"""Recovery of a step that does not converge: in halves, down to a bound (`solve/report.py`)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pdvol.errors import ConvergenceError
from pdvol.integrate.integrator import ImplicitEuler, Integrator, Past, State
from pdvol.integrate.scripted_motion import ScriptedMotion
from pdvol.levels.script import Mover
from pdvol.potentials.potential import Positions
from pdvol.solve.report import NewtonReport, StepReport, taken


@dataclass(frozen=True, eq=False)
class Span:
    """The part of a step that is solved at once.

    Attributes
    ----------
    start : Positions
    x_hat : (n_owned, d) predicted positions [m]
    weight : of the potential [s^2]
    t0, t1 : its ends [s]
    """

    start: Positions
    x_hat: np.ndarray
    weight: float
    t0: float
    t1: float


class Attempt(Protocol):
    """One try at a span; `robust` tries use the strongest projection and the direct solver."""

    def __call__(self, report: StepReport, span: Span, robust: bool) -> tuple[Positions, NewtonReport]: ...


@dataclass(frozen=True, eq=False)
class Recovery:
    """The steps of one level, with remedies where they do not converge.

    Attributes
    ----------
    motion : ScriptedMotion
    attempt : Attempt
    max_halvings : how often a step may be halved
    """

    motion: ScriptedMotion
    attempt: Attempt
    max_halvings: int

    def advance(
        self, report: StepReport, integrator: Integrator, x_t: Positions, past: Past, t0: float, t1: float
    ) -> Positions:
        """The state at t1 [s], from x_t and the last states at t0 (owned rows), of which x_t is the first. Collective.

        Raises ConvergenceError where halving the step `max_halvings` times does not help.
        """
        return self._advance(report, integrator, x_t, past, t0, t1, 0)

    def _advance(
        self,
        report: StepReport,
        integrator: Integrator,
        x_t: Positions,
        past: Past,
        t0: float,
        t1: float,
        depth: int,
    ) -> Positions:
        lags, dt, deepest = self.motion.lags, t1 - t0, depth == self.max_halvings
        span = Span(x_t, integrator.predict(past, dt), integrator.weight(past, dt), t0, t1)
        x, solved = self._try(report, span, lags)
        if x is None and deepest:
            report.remedies["last_resort"] += 1
            x, solved = self._try(report, span, lags, robust=True)
        if x is not None:
            return x
        if deepest:
            raise ConvergenceError(
                report.level,
                report.step,
                f"{solved.reason} after {report.cuts} cuts of the step, last at dt = {dt:.3g} s, Newton step"
                f" {solved.speed:.3g} m/s (tried: {taken(report.remedies)}); try a smaller dt or a larger dhat",
            )
        report.cuts += 1
        report.remedies["halvings"] += 1
        self.motion.begin_span(t0, t1, lags)
        middle, halves = 0.5 * (t0 + t1), ImplicitEuler()  # it needs no constant steps
        halfway = self._advance(report, halves, x_t, past[:1], t0, middle, depth + 1)
        velocity = (halfway.owned - x_t.owned) / (middle - t0)
        return self._advance(report, halves, halfway, (State(halfway.owned, velocity),), middle, t1, depth + 1)

    def _try(
        self, report: StepReport, span: Span, lags: Mapping[Mover, float], robust: bool = False
    ) -> tuple[Positions | None, NewtonReport]:
        """The state at a span's end, or None; motions set out late by their `lags` [s]."""
        self.motion.begin_span(span.t0, span.t1, lags)
        x, solved = self.attempt(report, span, robust)
        if not solved.converged:
            return None, solved
        report.reason, report.gradient_norm = solved.reason, solved.gradient_norm
        return x, solved
