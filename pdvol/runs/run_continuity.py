"""Continuity of a stored level: the forces that its scene has at stored states, and the x_hat of each step."""

from collections.abc import Sequence

import numpy as np

from pdvol.integrate.feedback import level_feedback
from pdvol.integrate.marches import guide, led, mean_of_forces
from pdvol.integrate.replay import Replay
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import level_model
from pdvol.levels.script import Obstacle
from pdvol.measure import metrics
from pdvol.potentials.consistency import Consistency, Guide
from pdvol.potentials.potential import Positions
from pdvol.runs.stored_fields import stored_lead, stored_past
from pdvol.scene import Scene
from pdvol.stages import say
from pdvol.store.reader import Run, RunLevel

# By method: the level whose states predict the positions x_hat of a level above 0.
PREDICTED_WITH = {"direct": "own", "tracks": "own", "progressive": "coarse", "embedded": "none"}


def continuity_of_level(
    run: Run, level: RunLevel, scene: Scene, obstacles: Sequence[Obstacle], hierarchy: Hierarchy, masses: np.ndarray
) -> dict:
    """`continuity` and `continuity_error` of a level with masses (n,) [kg]: lists over its steps, as
    `pdvol.runs.run_metrics.measure_run` gives them.
    """
    method, taken = run.info["method"], "own"
    guides: tuple[Guide, ...] = ()
    if level.index:
        below, prolongation = run.levels[level.index - 1], hierarchy.prolongation(level.index)
        taken, weight = PREDICTED_WITH[method], scene.penalty.of(method)
        guides = (guide(weight, run.dt, prolongation, below.positions),) if weight > 0.0 else ()
    model = level_model(scene, hierarchy, level.index, run.info["diagonal"], obstacles)
    feedback = level_feedback(model, hierarchy, method, below.positions) if level.index else ()
    replay = Replay(model, hierarchy[level.index], guides)
    integrator = replay.integrator
    special = {r["step"] for r in level.log if r.get("cuts", 0) or r.get("reached", 1.0) < 1.0}
    # These steps start from obstacles that were held back.
    special |= {r["step"] + 1 for r in level.log if r.get("reached", 1.0) < 1.0}
    values, errors, masses = [], [], np.where(model.free, masses, 0.0)
    memories = {r["step"]: r["terms"] for r in level.log if r.get("terms")}
    crossing = {r["step"] for r in level.log if r.get("intersections", 0)}
    for number in range(1, level.steps):
        say(f"continuity, step {number} of {level.steps - 1}")
        if number in crossing:
            values.append(float("nan"))
            errors.append(float("nan"))
            continue
        past, after = stored_past(run, integrator, number - 1, model), level.positions(number)
        own, weight = integrator.predict(past, run.dt), integrator.weight(past, run.dt)
        end = replay.put(number, past, after, memories.get(number - 1), level.lateness)
        pull, guided = (weight * each for each in _pulls(replay, end))
        errors.append((run.dt**2 / weight) ** 2 * metrics.continuity_error(own, after, pull, masses))
        if taken == "none" or number in special:
            values.append(float("nan"))
            continue
        predicted, now = own, past[0].positions
        if taken == "coarse":
            coarse = lambda step: stored_lead(run, integrator, step, model)
            predicted = integrator.predict(led(now, coarse(number - 1), prolongation), run.dt)
            change = mean_of_forces(integrator, coarse, number, run.dt)
            predicted = predicted if change is None else predicted + prolongation.prolong(change)
        pushes = (push(number - 1, now) for push in feedback)
        values.append(metrics.continuity(own, sum(pushes, start=predicted), after, pull, masses, guided))
    return {"continuity": values, "continuity_error": errors}


def _pulls(replay: Replay, end: Positions) -> list[np.ndarray]:
    """M^-1 grad F [m/s^2], shape (n, d), of terms that were put to these positions; and the guides' part of it, which F
    does not contain. NaN where the positions are not admissible (inverted cells).
    """
    unknown = 0.0 if np.isfinite(sum(term.value(end) for term in replay.terms)) else np.nan
    parts = ([term for term in replay.terms if isinstance(term, Consistency) == guided] for guided in (False, True))
    return [replay.space.to_input(unknown - replay.force(end, terms) / replay.mass) for terms in parts]


def three_states(level: RunLevel, number: int, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions before, at the start and at the end of step `number`; those before the first step follow from the
    initial velocity.
    """
    now = level.positions(number - 1)
    return level.positions(number - 2) if number > 1 else now - dt * level.velocities(0), now, level.positions(number)
