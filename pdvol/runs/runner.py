"""From a shot to a run folder: builds the levels, marches them coarse to fine, stores every step. Collective."""

import platform
import shutil
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mpi4py import MPI
from threadpoolctl import threadpool_limits

from pdvol.errors import InputError
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import level_model
from pdvol.levels.obstacles import placed_obstacles, stored_obstacles
from pdvol.levels.scene_fields import initial_velocity, way_up
from pdvol.levels.start import start_positions
from pdvol.meshing.cache import installed
from pdvol.native import library
from pdvol.parallel import on_root
from pdvol.registry import INTERPOLANTS, METHODS
from pdvol.runs.fingerprint import describe, differences_by_level
from pdvol.runs.known_scenes import is_own_run, note_run
from pdvol.runs.launcher import chosen_ranks, require_ranks, side_by_side
from pdvol.runs.level_processes import NoRanks, march_levels
from pdvol.runs.level_run import Watch, run_level
from pdvol.runs.preparation import Prepared, prepared_levels
from pdvol.runs.render_meshes import bound_render_meshes, check_render_files
from pdvol.runs.scene_file import Shot, both_described, stored_file, stored_shot, with_hand
from pdvol.runs.shared_writer import SharedWriter
from pdvol.runs.stored_fields import exported
from pdvol.scene import Hand, Scene
from pdvol.scene.hand import same_up_to
from pdvol.solve.linear.petsc_methods import check_options
from pdvol.stages import stage
from pdvol.store.files import jsonable
from pdvol.store.folder import RECORD, holds_run, in_use, is_newer, read_info, require_free, require_scene
from pdvol.store.obstacles import write_obstacles
from pdvol.store.reader import Run, open_run
from pdvol.store.render_meshes import write_render_meshes
from pdvol.store.writer import RunWriter

LIBRARIES: tuple[str, ...] = ("pdvol", "fenics-dolfinx", "dolfinx-solver-real", "petsc4py", "ipctk", "numpy", "scipy")
LIBRARIES += ("pytetwild", "gmsh", "fast-simplification")
LISTED_CHANGES = 6  # changes of a scene: a message lists no more


@dataclass(frozen=True)
class Execution:
    """How levels are marched, and what is left of them.

    Attributes
    ----------
    progress : called as (level, steps, steps done) when a level begins, on the ranks where it is given
    wavefront : run the levels side by side, each in processes of its own; `comm` then has one rank. Where that pays and
        cores are idle when None
    ranks : MPI ranks on which each level runs, in processes of its own; as many as pay and as the machine has idle
        cores for when None; `comm` then has one rank
    xdmf : write level_N.xdmf at the end; without it `pdvol export` makes it later. Where states are newer when None
    replace : a run that the folder holds, if of no more than one level, gives way once the new levels are ready
    done : called on rank 0 before level_N.xdmf is written, where all levels are done
    comm : of the ranks that take part
    """

    progress: Watch | None = None
    wavefront: bool | None = False
    ranks: int | None = 1
    xdmf: bool | None = True
    replace: bool = False
    done: Callable[[], object] = lambda: None
    comm: MPI.Comm = field(default_factory=lambda: MPI.COMM_WORLD)


USUAL = Execution()


# Sparse fronts and small blocks: threads of the BLAS cost more than they give, and ranks would fight over the cores.
@threadpool_limits.wrap(limits=1)
def run_scene(
    shot: Shot,
    out: str | Path,
    first: int = 0,
    last: int | None = None,
    method: str = "progressive",
    prolongation: str = "barycentric",
    resume: bool = False,
    how: Execution = USUAL,
) -> Path:
    """Simulate levels `first` to `last` of a shot into the run folder `out`. Collective.

    Parameters
    ----------
    shot : from a file (`load_shot`), or made in memory
    out : run folder: a new one, or with `resume` (or `first` > 0) one of the same scene, of which finished steps are
        kept
    first, last : levels, both included; the finest when `last` is None
    method : one of `pdvol.registry.METHODS`
    prolongation : a name in `pdvol.registry.INTERPOLANTS`

    Returns
    -------
    Path of the run folder.

    Raises
    ------
    InputError
        Something in the scene, its meshes or the folder is invalid; nothing is half-written.
    LevelError
        No mesh came out for a level; coarser ones are simulated before.
    ConvergenceError
        A step could not be solved; everything up to the last good step is kept.
    """
    scene, out, comm, wavefront, ranks = shot.scene, Path(out), how.comm, how.wavefront, how.ranks
    last = scene.levels - 1 if last is None else last
    check_choices(scene, first, last, method, prolongation)
    on_root(comm, lambda: _check_folder(out, first, last, method, resume or first > 0, how.replace))
    _check_processes(shot, how)
    library.build_beside()
    levels = on_root(comm, lambda: _prepare(shot, out, last, method, prolongation, how.replace))
    marched = range(first, last + 1 if levels.refused is None else levels.refused.level)
    if levels.refused is not None and not marched:
        raise levels.refused
    obstacles = placed_obstacles(scene.obstacles, levels.geometry)
    writer = SharedWriter(comm, lambda: _open_writer(shot, out, levels, obstacles, method, prolongation, how.replace))
    alone = comm.size > 1 or shot.file is None
    left = [scene.steps + 1 - writer.call("steps", level) for level in marched]
    newer = lambda: max(left) <= 0 and all(is_newer(out / f"level_{level}.xdmf", out) for level in marched)
    exports = how.xdmf or (how.xdmf is None and not on_root(comm, newer))
    with exported(comm, out, scene, obstacles, how.done) if exports else nullcontext():
        try:
            if wavefront is None and not alone:
                wavefront = side_by_side([len(levels.meshes[level].points) for level in marched], left)
            hierarchy = Hierarchy(levels.meshes, comm, prolongation)
            for together in [marched] if wavefront else [[level] for level in marched]:
                counts = {level: 1 if alone else _ranks_of(level, scene, levels, writer, ranks) for level in together}
                if wavefront or max(counts.values()) > 1:
                    try:
                        march_levels(writer, counts, how.progress)
                        continue
                    except NoRanks as error:
                        if ranks is not None:  # pdvol's own choice must not end a run that this process can do
                            raise
                        ranks = 1
                        if how.progress is not None:
                            print(f"note: {error}; it goes on with one", file=sys.stderr)
                for level in together:
                    with stage(f"evaluating the scene on level {level}"):
                        model = level_model(scene, hierarchy, level, levels.diagonal, obstacles)
                    run_level(model, hierarchy, method, writer, how.progress)
        finally:
            if scene.played is not None:
                _end_take(writer, scene.played)
            writer.close()
    if levels.refused is not None:
        raise levels.refused
    return out


def _check_processes(shot: Shot, how: Execution) -> None:
    """InputError unless a shot can be simulated on these ranks and by processes of its levels. Collective."""
    if how.wavefront and shot.file is None:
        raise InputError("levels side by side need a scene file, which their processes load; save the scene as one")
    if shot.scene.played is not None and how.comm.size > 1:
        raise InputError("a hand plays level 0 on one rank; leave out mpirun")
    if how.wavefront and how.comm.size > 1:
        raise InputError("--wavefront starts a process per level; leave out mpirun, or run levels one after the other")
    require_ranks(how.ranks, how.comm)


def _ranks_of(level: int, scene: Scene, levels: Prepared, writer: SharedWriter, wanted: int | None) -> int:
    """Ranks for what is left of a level, of which `wanted` are asked for; 1 where nothing is."""
    done = writer.call("steps", level)
    if done > scene.steps:
        return 1
    before = int(writer.record(level, done - 1).get("ranks", 0))
    return chosen_ranks(
        len(levels.meshes[level].points), 1 if scene.played is not None and not level else wanted, before
    )


def refine_run(out: str | Path, last: int, how: Execution = USUAL) -> Path:
    """Simulate the finer levels of a stored run, up to `last`; finished steps of coarser ones are kept. Collective."""
    info = on_root(how.comm, lambda: open_run(out).info)
    require_scene(Path(out), info)
    try:
        file = stored_file(info)
    except InputError as error:
        mend = "; put it back, or use pdvol run --resume with another path" if info["scene_file"] else ""
        raise InputError(f"{out}: {error}{mend}") from error
    shot = stored_shot(info, is_own_run(Path(out), file))
    if shot.scene.played is not None:  # its process was killed
        hand = Hand(shot.scene.played.file)
        shot = with_hand(shot, hand, min(shot.scene.steps, hand.steps))
    how = replace(how, xdmf=None if how.xdmf else False)
    return run_scene(shot, out, 0, last, info["method"], info["prolongation"], True, how)


def _end_take(writer: SharedWriter, hand: Hand) -> None:
    """A take is as long as its level 0 has come."""
    done = max(0, writer.call("steps", 0) - 1)
    hand.keep(done)
    writer.call("update_info", steps=done, channel=None)
    if read_info(writer.path)["levels"][0]["state"] == "running":
        writer.call("set_level_state", 0, "done")


def check_choices(scene: Scene, first: int, last: int, method: str, prolongation: str) -> None:
    """InputError unless levels `first` to `last` can be marched by these names."""
    if method not in METHODS:
        raise InputError(f"unknown method {method!r}; choose one of {', '.join(METHODS)}")
    INTERPOLANTS.check(prolongation)
    check_options(scene.solver)
    if method == "tracks" and scene.penalty.weight == 0.0:
        raise InputError("the method tracks needs a weight above zero, as in Penalty(weight=0.1) or --set weight=0.1")
    if not 0 <= first <= last < scene.levels:
        raise InputError(f"levels {first}:{last} do not exist; the scene has levels 0:{scene.levels - 1}")


def _check_folder(out: Path, first: int, last: int, method: str, go_on: bool, replace: bool) -> None:
    require_free(out, go_on or replace)
    exists = holds_run(out)
    count = len(read_info(out)["levels"]) if exists and replace else 0
    if count > 1:
        raise InputError(f"{out} holds a run of {count} levels; choose another folder for a preview with --out")
    if first > 0 and not exists and method != "direct":
        raise InputError(
            f"level {first} is refined from level {first - 1}, and {out} holds no run yet; begin with levels 0:{last}"
        )


def _prepare(shot: Shot, out: Path, last: int, method: str, prolongation: str, replace: bool) -> Prepared:
    """The levels of a run, stored ones first."""
    check_render_files(shot.scene)
    if not holds_run(out):
        return prepared_levels(shot.scene, last)
    run = open_run(out)
    if run.in_use:
        raise InputError(in_use(out))
    if replace:
        return prepared_levels(shot.scene, last)
    stored = [level.mesh for level in run.levels[: _same_levels(run, shot, last, method, prolongation)]]
    if stored and not run.info.get("branched", {"whole": True}).get("whole") and len(stored) <= last:
        raise InputError(
            f"{out} went on from step {run.info['branched']['step']} of another run, and has no level {len(stored)} of"
            f" that one; it has levels 0:{len(stored) - 1}"
        )
    # A run goes on with the lengths that it began with.
    levels = prepared_levels(shot.scene, last, stored, run.info["diagonal"] if stored else None)
    if 0 < len(stored) < len(levels.meshes) and levels.mended != run.info.get("mended", []):
        raise InputError(
            f"{out}: with the levels as they are now, bodies are set apart otherwise than in the stored ones; choose"
            " another folder"
        )
    return levels


def _same_levels(run: Run, shot: Shot, last: int, method: str, prolongation: str) -> int:
    """The number of coarsest levels that are still the shot's; InputError where none, or one is not asked for."""
    require_scene(run.path, run.info)
    for name, now in (("method", method), ("prolongation", prolongation)):
        if run.info[name] != now:
            raise InputError(f"{run.path} was run with {name} {run.info[name]!r}, not {now!r}; choose another folder")
    changed, same, levels_changed = differences_by_level(*both_described(run.info, shot))
    changed += [] if same else levels_changed
    if not same_up_to(run.levels[0].steps - 1, run.hand, shot.scene.hand):
        changed.append("what a hand did")
    if changed:
        more = f"; and {len(changed) - LISTED_CHANGES} more" if len(changed) > LISTED_CHANGES else ""
        raise InputError(
            f"{run.path} holds another scene ({'; '.join(changed[:LISTED_CHANGES])}{more}); choose another folder"
        )
    if len(run.levels) > shot.scene.levels:
        raise InputError(
            f"{run.path} holds {len(run.levels)} levels, the scene has {shot.scene.levels} now; choose another folder"
        )
    if same < len(run.levels) and last < len(run.levels) - 1:
        raise InputError(
            f"{run.path}: levels from {same} on have changed ({'; '.join(levels_changed[:LISTED_CHANGES])}); "
            f"simulate them anew with levels up to {len(run.levels) - 1}, or choose another folder"
        )
    return min(same, len(run.levels))


def _open_writer(
    shot: Shot, out: Path, levels: Prepared, obstacles: Sequence, method: str, prolongation: str, replace: bool
) -> RunWriter:
    scene, meshes, kept, mended = shot.scene, levels.meshes, levels.kept, levels.mended
    if shot.file is not None:
        note_run(out, shot.file)
    starts = [start_positions(scene, mesh, level) for level, mesh in enumerate(meshes)]
    velocities = [initial_velocity(scene, mesh, start) for mesh, start in zip(meshes, starts, strict=True)]
    drawn = stored_obstacles(obstacles, scene.dt, scene.steps)
    apart = bool(mended or (kept and open_run(out).info.get("mended")))
    rendered = bound_render_meshes(scene, meshes, apart)
    if kept:
        writer = RunWriter.open(out)
        writer.keep_levels(kept)
        for level in range(len(writer.info["levels"]), len(meshes)):
            writer.add_level(meshes[level], velocities[level])
        # The same scene from memory keeps the stored path and its settings, by which it can be made again.
        same = shot.file is None and writer.info["description"] == jsonable(shot.description())
        changed: dict[str, Any] = {} if same else shot.kept()
        solvers = [*writer.info.get("solvers", []), _solver(scene, writer)]
        if len(solvers) == 1 or solvers[-2]["settings"] != solvers[-1]["settings"]:
            changed["solvers"] = solvers
        writer.update_info(steps=scene.steps, **changed)
    else:
        info = {"scene": shot.name, "dt": scene.dt, "steps": scene.steps, "method": method}
        info |= {"prolongation": prolongation, **shot.kept(), "diagonal": levels.diagonal}
        info |= {"versions": {"python": platform.python_version(), **installed(LIBRARIES)}}
        info |= {key: value for key, value in (("up", way_up(scene, meshes[0].dim)), ("mended", mended)) if value}
        writer = RunWriter.create(out, info, meshes, [body.name for body in scene.bodies], velocities, replace)
        writer.update_info(solvers=[_solver(scene, writer)])
    if scene.hand is not None:
        writer.update_info(hand=RECORD, channel=scene.hand.channel)
        if scene.played is not None:
            scene.hand.keep(max(0, writer.steps(0) - 1))
        elif scene.hand.file.resolve() != (out / RECORD).resolve():
            shutil.copyfile(scene.hand.file, out / RECORD)
    write_obstacles(out, drawn)
    write_render_meshes(out, rendered)
    return writer


def _solver(scene: Scene, writer: RunWriter) -> dict:
    """The solver's settings with the steps from which on they hold, one for each level, as JSON."""
    begin = [max(writer.steps(level), 1) for level in range(len(writer.info["levels"]))]
    return jsonable({"from": begin, "settings": describe(scene.solver)})
