"""A new run that begins with the stored states of another one, and goes on with changed settings.

Step s of a run follows from its states up to step s - 1 and the settings. So a branch at step s is sound where its
states are those of a run with the same meshes, time step, integrator, obstacles and supports. What else differs
(materials, loads, friction, solver) acts from step s + 1 on. A level that the first run had not brought to that step
cannot be refined in the branch: it would have the new settings from its start. `run.json` names the first run.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.levels.initial_state import count_intersections
from pdvol.levels.obstacles import ground_of, placed_obstacles
from pdvol.levels.script import Script
from pdvol.levels.separation import build_apart
from pdvol.runs.scene_file import DEFAULTS, Shot
from pdvol.scene.fingerprint import differences
from pdvol.store.copying import copy_run, require_new
from pdvol.store.files import write_bytes, write_json
from pdvol.store.folder import hold, require_scene
from pdvol.store.log import log_line, read_log
from pdvol.store.reader import Run, RunLevel, open_run

SAME_PARTS = ("dt", "obstacles", "supports", "integrator")  # of a description: what a stored state depends on
MEMORY = ("solver_memory", "rest")  # of a record: what a solver remembers, which other settings make void


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
    _check_same(run, shot, step)
    reached = next((i for i, level in enumerate(run.levels) if level.steps <= step), len(run.levels))
    if last >= reached:
        raise InputError(
            f"level {reached} of {source} has not reached step {step}, and would begin with other settings than level 0"
            f" did; go on with levels 0:{reached - 1}, or from an earlier step"
        )
    _check_states(run.levels[: last + 1], shot, step, source)
    info = copy_run(source, out, step + 1, last + 1)
    with hold(out):
        if {**DEFAULTS, **info["description"]} != _described(shot):
            _forget(out, step)
        info |= {
            "parameters": dict(shot.parameters),
            "description": shot.description(),
            "scene_file": "" if shot.file is None else str(shot.file),
            "steps": shot.scene.steps,
            "branched": {"run": str(source.resolve()), "step": step, "parameters": run.info["parameters"]},
        }
        write_json(out / "run.json", info)


def _described(shot: Shot) -> dict:
    return {**DEFAULTS, **shot.description()}


def _starts(description: dict) -> list:
    """The bodies' `start`, from which supports and springs have their places and lengths."""
    return [body.get("start") for body in description["bodies"]]


def _check_same(run: Run, shot: Shot, step: int) -> None:
    if run.info["method"] != "progressive":
        raise InputError(f"{run.path} was run with the method {run.info['method']}; only progressive runs go on")
    old, new = ({**d, "start": _starts(d)} for d in ({**DEFAULTS, **run.info["description"]}, _described(shot)))
    for part in (*SAME_PARTS, "start"):
        changed = differences(old.get(part), new.get(part), f"scene.{part}")
        if changed:
            raise InputError(f"a run cannot go on from step {step} with another {part} ({changed[0]})")


def _check_states(levels: Sequence[RunLevel], shot: Shot, step: int, source: Path) -> None:
    """InputError unless the meshes are those of the scene, and its states at the step are free of intersections."""
    scene = shot.scene
    obstacles = placed_obstacles(scene.obstacles)
    meshes, _ = build_apart(scene, len(levels), obstacles)
    for level, mesh in zip(levels, meshes, strict=True):
        for name in ("points", "cells", "bodies", "regions"):
            if not np.array_equal(getattr(level.mesh, name), getattr(mesh, name)):
                raise InputError(
                    f"a run cannot go on from step {step} with another mesh or placement ({name} of level"
                    f" {level.index} differ from those in {source})"
                )
        if scene.contact:
            script = Script((), obstacles, ground_of(scene.supports, obstacles, scene.dt * scene.steps))
            places = script.placed(step * scene.dt, script.recorded_lags(level.behind(step), level.late(step)))
            names = [body.name for body in scene.bodies]
            count = count_intersections(mesh, level.positions(step), obstacles, names, places)
            if count:
                raise InputError(f"level {level.index} has {count} intersections at step {step}; contact cannot begin")


def _forget(out: Path, step: int) -> None:
    """Drop from the records of a step what the solver remembered of it with other settings."""
    records = read_log(out / "log.jsonl")
    for record in records:
        if record.get("step") == step:
            for key in MEMORY:
                record.pop(key, None)
    write_bytes(out / "log.jsonl", b"".join(log_line(record) for record in records))
