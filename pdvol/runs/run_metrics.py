"""The measures of `pdvol.measure.metrics` for a stored run, with forces from its scene and P from its meshes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import body_sizes, lumped_masses
from pdvol.geometry.rigid_motions import drift, mass_centres, rigid_motions
from pdvol.integrate.feedback import level_feedback
from pdvol.integrate.marches import guide, led, mean_of_forces
from pdvol.integrate.replay import Replay
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import level_model
from pdvol.levels.prolongation import Prolongation
from pdvol.levels.script import Obstacle
from pdvol.measure import metrics
from pdvol.potentials.consistency import Consistency, Guide
from pdvol.potentials.potential import Positions
from pdvol.runs.stored_fields import (
    level_densities,
    stored_densities,
    stored_hierarchy,
    stored_lead,
    stored_past,
    stored_scene,
)
from pdvol.scene import Friction, Scene
from pdvol.stages import say, stage
from pdvol.store.files import require_writable, write_json
from pdvol.store.reader import Run, RunLevel, open_run

# By method: the level whose states predict the positions x_hat of a level above 0.
PREDICTED_WITH = {"direct": "own", "tracks": "own", "progressive": "coarse", "embedded": "none"}


def measure_run(path: str | Path) -> dict:
    """All metrics of a stored run, finished or not.

    Returns
    -------
    dict
        `run`, `dt`, `method`, `prolongation`, `notes` (what could not be measured, and why) and `levels`, each with
        `level`, `steps`, `mass` [kg], lists over steps 1, 2, ... (`continuity`, `continuity_error`, `jitter`),
        `roughness` [m] around steps 2, 3, ..., `rougher`, its root mean square over that of level 0, and, from level 1
        on, over states 0, 1, ... of both levels (`consistency`, `distance`, and the largest drift of a body:
        `centre_drift` [m] and `angle_drift` [degrees] from the level below, the same with `_from_0` from level 0), the
        `projection`'s `rank` and `columns`, the drift of each of the `bodies`, `animation`, which says in a line
        whether the level ends as level 0, and `summary`: mean, median, largest and last value of each list. Steps that
        were cut, or whose scripted motion contact stopped, have no x_hat of their own: their continuity is NaN. The
        continuity of embedded levels, which have no x_hat, is NaN as well. In states with intersections or inverted
        cells the forces are meaningless: continuity and its error are NaN.

    Raises
    ------
    InputError
        When the folder is no run or holds no state, or a state is damaged.
    """
    run = open_run(path)
    notes: list[str] = []
    hierarchy = stored_hierarchy(run)
    scene, obstacles = _scene(run, notes)
    densities = level_densities(run, scene, notes)
    levels = []
    for level in run.levels:
        if not level.steps:
            continue
        with stage(f"measuring level {level.index} of {path}"):
            masses = lumped_masses(level.mesh, densities[level.index])
            entry: dict[str, Any] = {"level": level.index, "steps": level.steps - 1, "mass": float(masses.sum())}
            if scene is not None:
                entry |= continuity_of_level(run, level, scene, obstacles, hierarchy, masses)
            entry["jitter"] = [
                metrics.jitter(*three_states(level, n, run.dt), run.dt, masses) for n in range(1, entry["steps"] + 1)
            ]
            around = ([level.positions(n + k) for k in range(-2, 3)] for n in range(2, level.steps - 2))
            entry["roughness"] = [metrics.roughness(five, masses) for five in around]
            if level.index and run.levels[level.index - 1].steps:
                below = run.levels[level.index - 1]
                below_masses = lumped_masses(below.mesh, densities[below.index])
                entry |= _between_levels(level, below, hierarchy.prolongation(level.index), masses, below_masses)
                entry |= _drift(run, level, hierarchy, masses)
        levels.append(entry | {"summary": _summaries(entry)})
    if not levels:
        raise InputError(f"{path} has no stored state to measure")
    smooth = metrics.root_mean_square(levels[0]["roughness"])
    for entry in levels:
        entry["rougher"] = metrics.root_mean_square(entry["roughness"]) / smooth if smooth > 0.0 else float("nan")
    method = run.info.get("method", "")
    known = {"run": str(path), "dt": run.dt, "method": method, "prolongation": hierarchy.interpolant}
    return {**known, "notes": notes, "levels": levels}


def write_metrics(path: Path, against: Path | None = None, file: Path | None = None) -> dict:
    """Measure a run, and a second one beside it, into the run's `metrics.json` and into `file`.

    Returns
    -------
    dict
        As `measure_run`, with the other run's under `against` and the result of `compare_runs` under its `between`.

    Raises
    ------
    InputError
        A folder is no run or cannot be written, or the runs do not fit together.
    """
    open_run(path)
    files = [path / "metrics.json", *([file] if file is not None else [])]
    for target in files:
        require_writable(target)
    between = []
    if against is not None:
        with stage(f"comparing {path} with {against}"):
            between = compare_runs(path, against)
    result = measure_run(path)
    if against is not None:
        result["against"] = {**measure_run(against), "between": between}
    for target in files:
        write_json(target, result)
    return result


def motion_from_level_0(run: Run) -> list[dict[str, Any]]:
    """How far each finished level of a run is from level 0, prolonged to it by the run's own interpolant.

    Returns
    -------
    list of dict
        `level`, `vertices`; and above level 0 `distance` [m] at the end and `largest_distance` over all states (root
        mean square over the mass), and at the end the largest `centre_drift` [m] and `angle_drift` [degrees] of a
        body, which `body` has drifted furthest, and `centre_drifts` [m] by the names of bodies; `animation` says it in
        a line.
    """
    done = [level for level in run.levels if level.info["state"] == "done" and level.steps]
    hierarchy, densities = stored_hierarchy(run), stored_densities(run)
    found: list[dict[str, Any]] = []
    for level in done:
        entry: dict[str, Any] = {"level": level.index, "vertices": len(level.rest)}
        if level.index:
            masses = lumped_masses(level.mesh, densities[level.index])
            states = min(level.steps, run.levels[0].steps)
            lifted = (hierarchy.prolong(run.levels[0].positions(n), 0, level.index) for n in range(states))
            apart = [metrics.distance(level.positions(n), x, masses) for n, x in enumerate(lifted)]
            centres, angles = _drift_of_bodies(run, level, hierarchy, masses, 0, states - 1)
            entry |= {"distance": apart[-1], "largest_distance": max(apart)}
            entry |= {"centre_drift": float(centres.max()), "angle_drift": float(angles.max())}
            entry["body"] = run.info["bodies"][int(centres.argmax())]
            entry["centre_drifts"] = dict(zip(run.info["bodies"], centres.tolist(), strict=True))
            entry["animation"] = animation_line(level, run.info["bodies"], centres, angles)
        found.append(entry)
    return found


def last_animation(run: Run) -> str | None:
    """The `animation_line` of a run's finest level, and how often an embedded one crosses; None unless it and
    level 0 are finished.
    """
    level = run.levels[-1]
    if not level.index or run.info["state"] != "done" or run.levels[0].steps < level.steps:
        return None
    masses = lumped_masses(level.mesh, stored_densities(run)[level.index])
    drifts = _drift_of_bodies(run, level, stored_hierarchy(run), masses, 0, level.steps - 1)
    crossed = sum(r.get("intersections", 0) > 0 for r in level.log)
    crosses = f", but surfaces cross in {crossed} of {len(level.log)} steps" if crossed else ""
    return animation_line(level, run.info["bodies"], *drifts) + crosses


def animation_line(level: RunLevel, names: Sequence[str], centres: np.ndarray, angles: np.ndarray) -> str:
    """Whether a level ends as level 0, in a line; from there centres (b,) [m] and angles (b,) [degrees] of the bodies
    `names`. It takes the same limits as a study.
    """
    sizes = body_sizes(level.mesh)
    other = [repr(names[i]) for i in np.flatnonzero(metrics.elsewhere(centres, angles, sizes))]
    apart = f"{100 * (centres / sizes).max():.1f} % of the size, {angles.max():.1f} degrees from level 0"
    ends = f"another animation ({', '.join(other)})" if other else "same animation"
    return f"level {level.index}: {apart}: {ends}"


def compare_runs(path: str | Path, other: str | Path) -> list[dict]:
    """How far two runs of one shot are apart, per level that both have: `centre_error` [m] over common states and,
    where the meshes are the same, `distance` [m].
    """
    run, against = open_run(path), open_run(other)
    if run.dt != against.dt:
        raise InputError(
            f"{path} has dt {run.dt:g} s and {other} has {against.dt:g} s; compare runs with the same time step"
        )
    if run.info.get("bodies") != against.info.get("bodies"):
        raise InputError(f"{path} and {other} hold different bodies; compare runs of one shot")
    found = []
    densities = [stored_densities(r) for r in (run, against)]
    for level, its in zip(run.levels, against.levels, strict=False):
        states = min(level.steps, its.steps)
        if not states:
            continue
        say(f"level {level.index}")
        masses, theirs = (lumped_masses(x.mesh, of[x.index]) for x, of in zip((level, its), densities, strict=True))
        entry: dict[str, Any] = {"level": level.index, "steps": states - 1}
        weight = np.bincount(level.mesh.point_bodies, masses)
        centres = (
            np.array([mass_centres(x.positions(n), m, x.mesh.point_bodies) for n in range(states)])
            for x, m in ((level, masses), (its, theirs))
        )
        moved = zip(*(places - places[0] for places in centres), strict=True)
        entry["centre_error"] = [metrics.centre_error(a, b, weight) for a, b in moved]
        if level.rest.shape == its.rest.shape and np.array_equal(level.rest, its.rest):
            entry["distance"] = [metrics.distance(level.positions(n), its.positions(n), masses) for n in range(states)]
        found.append(entry | {"summary": _summaries(entry)})
    return found


def _scene(run: Run, notes: list[str]) -> tuple[Scene | None, Sequence[Obstacle]]:
    """The scene and its obstacles; None where forces cannot be computed; notes say so, and name what is left out."""
    try:
        if run.info.get("method") not in PREDICTED_WITH:
            raise InputError(f"x_hat of the method {run.info.get('method')!r} is not known")
        scene, obstacles = stored_scene(run)
    except InputError as error:
        notes.append(f"no continuity: {error}")
        return None, ()
    if any(c.iterations > 1 for c in scene.contact if isinstance(c, Friction)):
        notes.append("continuity lags friction once a step; the run did so several times")
    return scene, obstacles


def _between_levels(
    level: RunLevel, below: RunLevel, prolongation: Prolongation, masses: np.ndarray, below_masses: np.ndarray
) -> dict:
    projection, consistency, distance = metrics.Projection(prolongation.weights()), [], []
    states = min(level.steps, below.steps)
    for n in range(states):
        say(f"distance from the level below, step {n} of {states - 1}")
        fine, coarse = level.positions(n), below.positions(n)
        consistency.append(metrics.squared_norm(projection.difference(fine, coarse), below_masses))
        distance.append(metrics.distance(fine, prolongation.prolong(coarse), masses))
    shape = {"rank": projection.rank, "columns": projection.columns}
    return {"consistency": consistency, "distance": distance, "projection": shape}


def _drift(run: Run, level: RunLevel, hierarchy: Hierarchy, masses: np.ndarray) -> dict:
    """Drift of bodies from the level below and from level 0, both prolonged and fitted with the masses (n,) [kg]."""
    found: dict[str, Any] = {}
    bodies: list[dict] = [{"name": name} for name in run.info["bodies"]]
    for reference, suffix in ((level.index - 1, ""), (0, "_from_0")):
        states = min(level.steps, run.levels[reference].steps)
        apart = np.zeros((2, states, len(bodies)))
        for n in range(states):
            say(f"drift from level {reference}, step {n} of {states - 1}")
            apart[:, n] = _drift_of_bodies(run, level, hierarchy, masses, reference, n)
        for name, values in zip(("centre_drift", "angle_drift"), apart, strict=True):
            found[name + suffix] = values.max(axis=1).tolist()
            for body, its in zip(bodies, values.T, strict=True):
                body[name + suffix] = its.tolist()
    ends = (np.array([body[f"{name}_from_0"][-1] for body in bodies]) for name in ("centre_drift", "angle_drift"))
    return {**found, "bodies": bodies, "animation": animation_line(level, run.info["bodies"], *ends)}


def _drift_of_bodies(
    run: Run, level: RunLevel, hierarchy: Hierarchy, masses: np.ndarray, reference: int, step: int
) -> tuple[np.ndarray, np.ndarray]:
    """Of each body from the prolonged reference level: (b,) [m] and (b,) [degrees]."""
    lifted = hierarchy.prolong(run.levels[reference].positions(step), reference, level.index)
    return drift(
        *(rigid_motions(level.rest, x, masses, level.mesh.point_bodies) for x in (level.positions(step), lifted))
    )


def _summaries(entry: dict) -> dict:
    """Of each of its lists of numbers."""
    return {key: _summary(values) for key, values in entry.items() if isinstance(values, list) and key != "bodies"}


def _summary(values: Sequence[float]) -> dict:
    known = np.array([v for v in values if np.isfinite(v)])
    if not len(known):
        return {}
    found = {"mean": known.mean(), "median": np.median(known), "largest": known.max(), "last": known[-1]}
    return {key: float(value) for key, value in found.items()}


def continuity_of_level(
    run: Run, level: RunLevel, scene: Scene, obstacles: Sequence[Obstacle], hierarchy: Hierarchy, masses: np.ndarray
) -> dict:
    """`continuity` and `continuity_error` of a level with masses (n,) [kg]: lists over its steps, by the forces that
    its scene has at stored states and the x_hat of each step.
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
    """Positions before, at the start and at the end of step `number`; before the first by the initial velocity."""
    now = level.positions(number - 1)
    return level.positions(number - 2) if number > 1 else now - dt * level.velocities(0), now, level.positions(number)
