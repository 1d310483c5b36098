"""Recovery of a step that does not converge: in halves, down to a bound (`solve/report.py`)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pdvol.errors import ConvergenceError
from pdvol.integrate.scripted_motion import ScriptedMotion
from pdvol.levels.script import Mover
from pdvol.potentials.potential import Positions, Rates
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
    rates : how rates of change follow from its end; means over it where that is None
    """

    start: Positions
    x_hat: np.ndarray
    weight: float
    t0: float
    t1: float
    rates: Rates | None = None

    @classmethod
    def euler(cls, start: Positions, velocity: np.ndarray, t0: float, t1: float) -> "Span":
        """One step of implicit Euler, which needs no constant steps, with velocity (n_owned, d) [m/s] at its start."""
        return cls(start, start.owned + (t1 - t0) * velocity, (t1 - t0) ** 2, t0, t1)


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

    def advance(self, report: StepReport, span: Span, velocity: np.ndarray, depth: int = 0) -> Positions:
        """The state at the end of a span, which was halved `depth` times; its halves would begin with a velocity
        (n_owned, d) [m/s]. Collective.

        Raises ConvergenceError where halving the step `max_halvings` times does not help.
        """
        lags, deepest = self.motion.lags, depth == self.max_halvings
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
                f"{solved.reason} after {report.cuts} cuts of the step, last at dt = {span.t1 - span.t0:.3g} s, Newton"
                f" step {solved.speed:.3g} m/s (tried: {taken(report.remedies)}); try a smaller dt or a larger dhat",
            )
        report.cuts += 1
        report.remedies["halvings"] += 1
        self.motion.begin_span(span.t0, span.t1, lags)
        middle = 0.5 * (span.t0 + span.t1)
        halfway = self.advance(report, Span.euler(span.start, velocity, span.t0, middle), velocity, depth + 1)
        velocity = (halfway.owned - span.start.owned) / (middle - span.t0)
        return self.advance(report, Span.euler(halfway, velocity, middle, span.t1), velocity, depth + 1)

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
