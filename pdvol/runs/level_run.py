"""One level of a run, from where its store ends to the last step, by any method."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial

import numpy as np

from pdvol.errors import InputError, SimulationError
from pdvol.integrate.marches import Start, direct, embedded, guide, progressive
from pdvol.integrate.stepper import LevelProblem, StepReport
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.initial_state import count_intersections
from pdvol.levels.materials import level_materials
from pdvol.levels.scene_fields import initial_velocity
from pdvol.runs.obstacle_places import moving_places
from pdvol.runs.progress import Progress
from pdvol.scene import Scene

Watch = Callable[[int, int, int], Progress]


def run_level(
    scene: Scene,
    hierarchy: Hierarchy,
    level: int,
    method: str,
    obstacles,
    diagonal: float,
    writer,
    progress: Watch | None,
) -> None:
    """Marches one level from where its store ends to the last step; `writer` is shared by the ranks, or a `Follower`.
    Collective.
    """
    done = writer.call("steps", level)
    if done > scene.steps:
        writer.finish(level)
        return
    mesh = hierarchy[level].mesh
    if done == 0:
        start = Start(0, mesh.points, initial_velocity(scene, mesh))
        writer.call("write_state", level, 0, start.positions)
    else:
        start = Start(
            done - 1,
            writer.read(level, "positions", done - 1),
            writer.read(level, "velocities", done - 1),
            writer.record(level, done - 1),
        )
    writer.call("set_level_state", level, "running")
    march = _march(scene, hierarchy, level, method, obstacles, diagonal, partial(writer.read, level - 1), start)
    watcher = progress(level, scene.steps, start.step) if progress is not None else None
    try:
        for report in march:
            if report.behind > 0.0 and scene.obstacles:
                writer.call(
                    "write_late", level, report.step, moving_places(scene, obstacles, report.time - report.behind)
                )
            writer.call("write_state", level, report.step, report.positions, report.record())
            if watcher is not None:
                watcher.step(report.record())
        writer.finish(level)
    except (SimulationError, InputError) as error:  # a motion of the scene's own may fail on the way
        with suppress(SimulationError):  # a full disk, above all: what stopped the run is what is told
            writer.call("set_level_state", level, "failed", reason=str(error))
            writer.export(level)
        raise
    finally:
        if watcher is not None:
            watcher.close()


def _march(
    scene: Scene,
    hierarchy: Hierarchy,
    level: int,
    method: str,
    obstacles,
    diagonal: float,
    coarse: Callable[[str, int], np.ndarray],
    start: Start,
) -> Iterator[StepReport]:
    """The march of a method on a level; `coarse` gives `positions` or `velocities` of the level below at a step."""
    where = partial(coarse, "positions")
    if method == "embedded" and level > 0:
        mesh = hierarchy[level].mesh
        count = (
            {"count": lambda positions, time: count_intersections(mesh, positions, obstacles, scene, time)}
            if scene.contact
            else {}
        )
        return embedded(hierarchy.prolongation(level), where, level, start, scene.steps, scene.dt, **count)
    weight = scene.penalty.of(method) if level > 0 else 0.0
    guides = (guide(weight, scene.dt, hierarchy.prolongation(level), where),) if weight > 0.0 else ()
    problem = LevelProblem(
        scene,
        hierarchy[level],
        level,
        diagonal,
        obstacles,
        partial(hierarchy.coarse_weights, level),
        level_materials(scene, hierarchy, level),
        guides,
    )
    if method == "progressive" and level > 0:
        return progressive(problem, hierarchy.prolongation(level), partial(coarse, "velocities"), start, scene.steps)
    return direct(problem, start, scene.steps)
