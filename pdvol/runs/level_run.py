"""One level of a run: marches from the last stored state to the last step, and stores each step."""

from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache, partial

from pdvol.errors import InputError, SimulationError
from pdvol.integrate.integrator import Integrator, Past, past_of
from pdvol.integrate.level_march import Coarse, Lead, level_march
from pdvol.integrate.marches import Start
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import LevelModel
from pdvol.levels.script import Script
from pdvol.registry import INTEGRATORS, STUDIO
from pdvol.runs.progress import Calls, Progress
from pdvol.runs.shared_writer import SharedWriter
from pdvol.stages import stage

Watch = Callable[[int, int, int], Progress]


def run_level(
    model: LevelModel, hierarchy: Hierarchy, method: str, writer: SharedWriter, progress: Watch | None
) -> None:
    """Marches one level from where its store ends to the last step. Collective.

    Parameters
    ----------
    progress : called as (level, steps, steps done)
    """
    level, done = model.level, writer.call("steps", model.level)
    watcher: Progress = Calls()
    if done > model.steps:
        writer.call("set_level_state", level, "done")
        return
    with stage(f"preparing level {level}"):
        integrator = INTEGRATORS[model.integrator]()
        played = [pulls.hand for pulls in model.pulls if pulls.hand is not None and pulls.hand.channel is not None]
        player = STUDIO["player"](model, played[0], max(done - 1, 0)) if played and level == 0 else None
        lead = Lead(hierarchy, method, _coarse(model, integrator, writer))
        start = _start(model, lead, integrator, writer, done)
        writer.call("set_level_state", level, "running")
        march = level_march(model, lead, integrator, start, show=lambda record: watcher.lasts(record))
        march = march if player is None else player.led(march)
    if progress is not None:
        watcher = progress(level, model.steps, start.step)
    try:
        for report in march:
            if report.behind > 0.0 and model.obstacles:
                script = Script(model.supports, model.obstacles, model.ground)
                places = script.placed(report.time, script.recorded_lags(report.behind, report.late))
                moving = {i: o.stored(places[o]) for i, o in enumerate(model.obstacles) if o.moves}
                writer.call("write_late", level, report.step, moving)
            writer.call("write_state", level, report.step, report.positions, report.record())
            watcher.step(report.record())
        writer.call("set_level_state", level, "done")
    except (SimulationError, InputError) as error:  # a function of the scene may fail during the run
        with suppress(SimulationError):  # the disk may be full; the first error is the one to report
            writer.call("set_level_state", level, "failed", reason=str(error))
        raise
    finally:
        watcher.close()


def _start(model: LevelModel, lead: Lead, integrator: Integrator, writer: SharedWriter, done: int) -> Start:
    """Where a level goes on that has `done` stored states; where it has none, the first one is stored."""
    level, step = model.level, done - 1
    if done == 0:
        start = lead.start(model)
        writer.call("write_state", level, 0, start.past[0].positions)
        return start
    positions = partial(writer.read, level, "positions")
    past = past_of(
        integrator, positions, model.velocity, step, model.dt, partial(writer.record, level), model.begins_anew
    )
    record, *earlier = (writer.record(level, step - back) for back in range(integrator.states))
    return Start(step, past, record, earlier)


def _coarse(model: LevelModel, integrator: Integrator, writer: SharedWriter) -> Coarse:
    """The pasts of the stored level below; the last six are kept, which a step asks for."""
    level, kept = model.level - 1, lru_cache(maxsize=12)  # six pasts look at the states of nine steps
    positions, record = kept(partial(writer.read, level, "positions")), kept(partial(writer.record, level))

    @lru_cache(maxsize=6)
    def past(step: int) -> Past:
        velocity = writer.read(level, "velocities", 0)
        return past_of(integrator, positions, velocity, step, model.dt, record, model.begins_anew)

    return past
