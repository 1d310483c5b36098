"""A step that does not converge is tried with less of its scripted motion, then in halves, down to a bound (`solve/remedies.py`)."""

from typing import TYPE_CHECKING

from pdvol.errors import ConvergenceError
from pdvol.integrate.implicit_euler import ImplicitEuler
from pdvol.integrate.integrator import Integrator, Past, State
from pdvol.integrate.report import StepReport
from pdvol.potentials.potential import Positions
from pdvol.solve.newton import NewtonReport
from pdvol.solve.remedies import taken

if TYPE_CHECKING:
    from pdvol.integrate.stepper import Stepper

HELD_BACK = (
    0.25,
    0.0,
)  # shares of the motion carried out before a solve failed: with so much of it the step is tried again


def recovered(stepper: "Stepper", report: StepReport, past: Past, t0: float, t1: float) -> Positions:
    """The state at t1 [s], from the last states at t0 (owned rows). Collective.

    Raises ConvergenceError where halving the step `max_halvings` times does not help.
    """
    return _advance(stepper, report, stepper.integrator, Positions(stepper.space, past[0].positions), past, t0, t1, 0)


def _advance(
    stepper: "Stepper",
    report: StepReport,
    integrator: Integrator,
    x_t: Positions,
    past: Past,
    t0: float,
    t1: float,
    depth: int,
) -> Positions:
    motion, deepest = stepper.motion, depth == stepper.model.solver.max_halvings
    clock, dt = motion.clock, t1 - t0
    x_hat, weight = integrator.predict(past, dt), integrator.weight(past, dt)

    def attempt(target: float, careful: bool = False) -> tuple[Positions | None, NewtonReport]:
        motion.clock = clock
        x, solved = stepper.attempt(report, x_t, x_hat, weight, t0, t1, target, careful)
        if not solved.converged:
            return None, solved
        report.reason, report.gradient_norm = solved.reason, solved.gradient_norm
        return x, solved

    parts = report.remedies["substeps"]
    x, solved = attempt(t1)
    if report.remedies["substeps"] > parts:  # contact stood in the way of motions, which may have crushed what they met
        gained = motion.clock - clock
        for share in HELD_BACK:
            if x is None:
                report.remedies["held_back"] += 1
                x, solved = attempt(clock + share * gained)
    if x is None and deepest:
        report.remedies["last_resort"] += 1
        x, solved = attempt(t1, careful=True)
    if x is not None:
        return x
    if deepest:
        raise ConvergenceError(
            stepper.model.level,
            report.step,
            f"{solved.reason} after {report.cuts} cuts of the step, last at dt = {dt:.3g} s, Newton step"
            f" {solved.speed:.3g} m/s (tried: {taken(report.remedies)}); try a smaller dt or a larger dhat",
        )
    report.cuts += 1
    report.remedies["halvings"] += 1
    motion.clock = clock
    middle, parts_of_step = 0.5 * (t0 + t1), ImplicitEuler()  # it needs no constant steps
    halfway = _advance(stepper, report, parts_of_step, x_t, past[:1], t0, middle, depth + 1)
    velocity = (halfway.owned - x_t.owned) / (middle - t0)
    return _advance(stepper, report, parts_of_step, halfway, (State(halfway.owned, velocity),), middle, t1, depth + 1)
