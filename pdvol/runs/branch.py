"""A new run that begins with the stored states of another one, and goes on with changed settings.

Step s of a run follows from its states up to step s - 1 and the settings. So a branch at step s is sound where its
states are those of a run with the same meshes, time step and integrator, with the same supports, and obstacles and
supports at the same places up to step s: their motions may differ from then on. What else differs (materials, loads,
friction, solver) acts from step s + 1 on. A level that the first run had not brought to that step cannot be refined in
the branch then: it would have the new settings from its start. Where motions, or what a hand does, alone differ, it
can: up to step s they are the same. `run.json` names the first run.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.levels.initial_state import count_intersections
from pdvol.levels.obstacles import ground_of, placed_obstacles, stored_obstacles
from pdvol.levels.scene_fields import start_positions, support_label, supported_points
from pdvol.levels.script import Obstacle, Script
from pdvol.runs.fingerprint import differences
from pdvol.runs.scene_file import Shot, both_described, with_hand
from pdvol.runs.separation import build_apart
from pdvol.scene import Hand
from pdvol.scene.hand import same_up_to
from pdvol.store.copying import copy_run, require_new
from pdvol.store.files import write_json
from pdvol.store.folder import RECORD, hold, require_scene
from pdvol.store.log import read_log, write_log
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel, open_run

SAME_PARTS = ("dt", "supports", "integrator")  # of a description: what a stored state depends on
MOVED_PARTS = ("obstacles", "supports")  # of a description: what may move in another way from the step on
NOT_MOVED = 1e-6  # of the largest coordinate: two places are the same, which caches keep in single precision


def branch_run(shot: Shot, source: str | Path, step: int, out: str | Path, last: int) -> None:
    """Make `out` a run of `shot` with the states 0 to `step` of the run `source`; `run_scene` then goes on by `resume`.
    Serial.

    Parameters
    ----------
    shot : the scene with the settings from that step on
    source : a stored run, which may be in use
    step : the last state that is taken over
    out : a new folder
    last : the finest level wanted

    Raises
    ------
    InputError
        The states of `source` cannot begin a run of this scene, or a level has not reached the step; nothing is written
        then.
    """
    source, out = Path(source), Path(out)
    run = open_run(source)
    require_scene(source, run.info)
    require_new(out)
    steps = run.levels[0].steps
    if not 0 <= step < steps:
        raise InputError(f"{source} has no step {step} to go on from; there are 0 to {steps - 1}")
    if step >= shot.scene.steps:
        raise InputError(f"step {step} is the end of the shot, which has {shot.scene.steps} steps")
    hand = shot.scene.hand
    if shot.scene.played is not None:  # it goes on from what the run's hand has done
        shot = with_hand(shot, run.hand or shot.scene.played, shot.scene.steps)
    _check_same(run, shot, step)
    reached = next((i for i, level in enumerate(run.levels) if level.steps <= step), len(run.levels))
    if last >= reached:
        raise InputError(
            f"level {reached} of {source} has not reached step {step}, and would begin with other settings than level 0"
            f" did; go on with levels 0:{reached - 1}, or from an earlier step"
        )
    _check_states(run, shot, step, last, source)
    moved = [each.line(step)["obstacles"] if each else {} for each in (run.hand, shot.scene.hand)]
    if moved[0] != moved[1]:
        raise InputError(_moved_otherwise("what a hand has shifted", step, step))
    info = copy_run(source, out, step + 1, last + 1)
    before, now = both_described(info, shot)
    rest = [{key: value for key, value in d.items() if key not in MOVED_PARTS} for d in (before, now)]
    whole = rest[0] == rest[1] and run.info.get("branched", {}).get("whole", True)
    whole = whole and same_up_to(step, run.hand, shot.scene.hand)
    info.pop("hand", None)
    with hold(out):
        if hand is None:
            (out / RECORD).unlink(missing_ok=True)
        else:
            info |= {"hand": RECORD, "channel": hand.channel}
            Hand(out / RECORD).keep(step)
        if before != now:
            records = read_log(out / "log.jsonl")
            for record in records:
                if record.get("step") == step:  # what the solver remembered of it with other settings
                    record.pop("solver_memory", None)
            write_log(out / "log.jsonl", records)
        begun = {"run": str(source.resolve()), "step": step, "parameters": run.info["parameters"], "whole": whole}
        write_json(out / "run.json", info | {**shot.kept(), "steps": shot.scene.steps, "branched": begun})


def _check_same(run: Run, shot: Shot, step: int) -> None:
    if run.info["method"] != "progressive":
        raise InputError(f"{run.path} was run with the method {run.info['method']}; only progressive runs go on")
    old, new = both_described(run.info, shot)
    for description in (old, new):  # supports and springs have their places and lengths from the bodies' `start`
        description["start"] = [body.get("start") for body in description["bodies"]]
        description["supports"] = [{k: v for k, v in s.items() if k != "motion"} for s in description["supports"]]
    for part in (*SAME_PARTS, "start"):
        changed = differences(old.get(part), new.get(part), f"scene.{part}")
        if changed:
            raise InputError(f"a run cannot go on from step {step} with another {part} ({changed[0]})")


def _check_states(run: Run, shot: Shot, step: int, last: int, source: Path) -> None:
    """InputError unless the meshes are those of the scene, obstacles and supports were where its motions have them, and
    its states at the step are free of intersections.
    """
    scene = shot.scene
    obstacles = placed_obstacles(scene.obstacles)
    _check_obstacles(run, obstacles, scene.dt, step)
    meshes, _ = build_apart(scene, last + 1, obstacles)
    for level, mesh in zip(run.levels[: last + 1], meshes, strict=True):
        for name in ("points", "cells", "bodies", "regions"):
            if not np.array_equal(getattr(level.mesh, name), getattr(mesh, name)):
                raise InputError(
                    f"a run cannot go on from step {step} with another mesh or placement ({name} of level"
                    f" {level.index} differ from those in {source})"
                )
        start = start_positions(scene, mesh, level.index)
        held = [supported_points(scene, support, mesh, level.index, start) for support in scene.supports]
        script = Script(held, obstacles, ground_of((*held, *obstacles), scene.dt * scene.steps))
        _check_supports(run, level, shot, step, script)
        if scene.contact:
            places = script.placed(step * scene.dt, script.recorded_lags(*level.lateness(step)))
            names = [body.name for body in scene.bodies]
            count = count_intersections(mesh, level.positions(step), obstacles, names, places)
            if count:
                raise InputError(f"level {level.index} has {count} intersections at step {step}; contact cannot begin")


def _check_obstacles(run: Run, obstacles: Sequence[Obstacle], dt: float, step: int) -> None:
    """InputError unless the obstacles are those of the run, and where that has them up to the step."""
    drawn = run.obstacles
    if [(o.name, o.kind) for o in drawn] != [(o.name, o.kind) for o in obstacles]:
        names = [", ".join(o.name for o in those) or "none" for those in (drawn, obstacles)]
        raise InputError(f"a run cannot go on from step {step} with other obstacles ({names[0]} -> {names[1]})")
    for before, other in zip(drawn, map(DrawnObstacle.of, stored_obstacles(obstacles, dt, step)), strict=True):
        for key in ("faces", "edges"):
            if not np.array_equal(before.arrays.get(key, ()), other.arrays.get(key, ())):
                raise InputError(f"a run cannot go on from step {step} with another shape of obstacle {before.name!r}")
        for number in range(step + 1):
            at = [np.concatenate(o.plane(number)) if o.kind == "plane" else o.vertices(number) for o in (before, other)]
            if not _same_place(*at):
                raise InputError(_moved_otherwise(f"obstacle {before.name!r}", number, step))


def _check_supports(run: Run, level: RunLevel, shot: Shot, step: int, script: Script) -> None:
    """InputError unless what supports hold was where their motions have it up to the step, or is described alike."""
    scene = shot.scene
    before, now = ([s.get("motion") for s in d["supports"]] for d in (run.info["description"], shot.description()))
    if before == now:
        return
    for number in range(1, step + 1):
        time = number * scene.dt
        placed = script.at(time, script.recorded_lags(*level.lateness(number)))
        positions = level.positions(number)
        for i, points in enumerate(script.supports):
            if before[i] != now[i] and points.holds(time - scene.dt, scene.dt):
                place = placed.place(points, time) if points.moves else points.points
                if not _same_place(positions[points.mask], place):
                    raise InputError(_moved_otherwise(support_label(scene.supports[i], level.index), number, step))


def _same_place(one: np.ndarray, other: np.ndarray) -> bool:
    return one.shape == other.shape and bool(
        np.abs(one - other).max(initial=0.0) <= NOT_MOVED * np.abs(one).max(initial=1.0)
    )


def _moved_otherwise(what: str, number: int, step: int) -> str:
    return (
        f"a run cannot go on from step {step}: {what} is elsewhere at step {number}; its motion may differ from step"
        f" {step + 1} on, or go on from an earlier step"
    )
