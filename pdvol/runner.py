"""From a shot to a run folder: builds the levels, marches them coarse to fine, stores every step. All ranks call it together."""

import platform
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pdvol.animate.march import Start, direct, embedded, guide, progressive
from pdvol.describe import differences_by_level
from pdvol.errors import InputError, SimulationError
from pdvol.fields import SceneFields
from pdvol.hierarchy.build import read_obstacle
from pdvol.hierarchy.cell_materials import level_materials
from pdvol.hierarchy.hierarchy import Hierarchy
from pdvol.hierarchy.interpolants import INTERPOLANTS
from pdvol.hierarchy.level_mesh import LevelMesh
from pdvol.hierarchy.scene_fields import check_fields, initial_velocity, scene_diagonal
from pdvol.hierarchy.separate import build_apart
from pdvol.hierarchy.start_check import check_start, count_intersections
from pdvol.parallel import on_root
from pdvol.record.files import jsonable
from pdvol.record.folder import holds_run, in_use, require_scene
from pdvol.record.progress import Progress
from pdvol.record.reader import Run, open_run
from pdvol.record.series import nothing_more
from pdvol.record.store import RunWriter
from pdvol.record.xdmf import write_xdmf
from pdvol.scene import Gravity, Plane, Rigid, Scene, Still, moved
from pdvol.shot import Shot, load_shot, stored_settings
from pdvol.solve.level_problem import LevelProblem, StepReport
from pdvol.wavefront import march_levels

METHODS = ("progressive", "direct", "tracks", "embedded")
LIBRARIES = ("fenics-dolfinx", "petsc4py", "ipctk", "numpy", "scipy", "pytetwild", "gmsh", "fast-simplification")
MOST_PLACES = 20_000_000  # of vertices of moving obstacles, for pictures: half a GB
TOLD = 6  # changes that a message lists
PAUSE, SHARE = 20.0, 0.05  # at least so many seconds between exports of a level that goes on, and at most this share of the time

Watch = Callable[[int, int, int], Progress]


def run_scene(shot: Shot, out: str | Path, first: int = 0, last: int | None = None, method: str = "progressive",
              prolongation: str = "barycentric", resume: bool = False, comm: MPI.Comm = MPI.COMM_WORLD, progress: Watch | None = None,
              wavefront: bool = False) -> Path:
    """Simulate levels `first` to `last` of a shot into the run folder `out`. Collective.

    Parameters
    ----------
    shot : Shot
    out : run folder: a new one, or with `resume` (or `first` > 0) one of the same scene, of which finished steps are kept
    first, last : levels, both included; the finest when `last` is None
    method : one of METHODS
    prolongation : a key of `INTERPOLANTS`
    progress : called as (level, steps, steps done) when a level begins, on the ranks where it is given
    wavefront : run the levels side by side, each in a process of its own; `comm` then has one rank

    Returns
    -------
    Path of the run folder.

    Raises
    ------
    InputError
        Something in the scene, its meshes or the folder is unfit; nothing is half-written.
    ConvergenceError
        A step could not be solved; everything up to the last good step is kept.
    """
    scene, out = shot.scene, Path(out)
    last = scene.levels - 1 if last is None else last
    _check_request(scene, out, first, last, method, prolongation, resume or first > 0)
    if wavefront and comm.size > 1:
        raise InputError("--wavefront starts a process per level; leave out mpirun, or run the levels one after the other")
    meshes, kept, obstacles, diagonal, mended = on_root(comm, lambda: _prepare(shot, out, last, method, prolongation))
    writer = _SharedWriter(comm, lambda: _open_writer(shot, out, meshes, kept, obstacles, diagonal, method, prolongation, mended),
                           _Export(out, scene, obstacles))
    try:
        if wavefront:
            march_levels(writer, range(first, last + 1), scene.steps, progress)
        else:
            hierarchy = Hierarchy(meshes, comm, prolongation)
            for level in range(first, last + 1):
                run_level(scene, hierarchy, level, method, obstacles, diagonal, writer, progress)
    finally:
        writer.close()
    return out


def refine_run(out: str | Path, last: int, comm: MPI.Comm = MPI.COMM_WORLD, progress: Watch | None = None, wavefront: bool = False) -> Path:
    """Simulate the finer levels of a stored run, up to `last`; finished steps of coarser levels are not touched. Collective.

    Parameters as for `run_scene`.
    """
    info = on_root(comm, lambda: _scene_info(out))
    if not Path(info["scene_file"]).is_file():
        raise InputError(f"{out}: its scene file {info['scene_file']} is gone; put it back, or use pdvol run --resume with another path")
    shot = load_shot(info["scene_file"], stored_settings(info["parameters"]), info["steps"])
    return run_scene(shot, out, 0, last, info["method"], info["prolongation"], True, comm, progress, wavefront)


def _scene_info(out: str | Path) -> dict:
    info = open_run(out).info
    require_scene(Path(out), info)
    return info


def _check_request(scene: Scene, out: Path, first: int, last: int, method: str, prolongation: str, go_on: bool) -> None:
    for name, value, known in (("method", method, METHODS), ("prolongation", prolongation, tuple(INTERPOLANTS))):
        if value not in known:
            raise InputError(f"unknown {name} {value!r}; choose one of {', '.join(known)}")
    if method == "tracks" and scene.penalty.weight == 0.0:
        raise InputError("the method tracks needs a weight above zero, as in --set weight=0.1")
    if not 0 <= first <= last < scene.levels:
        raise InputError(f"levels {first}:{last} do not exist; the scene has levels 0:{scene.levels - 1}")
    exists = holds_run(out)
    if exists and not go_on:
        raise InputError(f"{out} already holds a run; go on with it by --resume, or choose another folder with --out")
    if first > 0 and not exists:
        raise InputError(f"level {first} is refined from level {first - 1}, and {out} holds no run yet; begin with --levels 0:{last}")


def _prepare(shot: Shot, out: Path, last: int, method: str, prolongation: str) -> tuple[Sequence[LevelMesh], int, list, float, list[str]]:
    """Meshes up to `last`, how many of the coarsest are stored ones, obstacles and the scene's diagonal, checked at t = 0; what was mended."""
    scene = shot.scene
    stored: list[LevelMesh] = []
    if holds_run(out):
        run = open_run(out)
        if run.in_use:
            raise InputError(in_use(out))
        stored = [level.mesh for level in run.levels[: _same_levels(run, shot, last, method, prolongation)]]
    obstacles = [read_obstacle(o) for o in scene.obstacles if isinstance(o, Rigid)]
    meshes, mended = stored, []
    if len(stored) <= last:
        built, mended = build_apart(scene, last + 1, obstacles)
        if stored and mended != run.info.get("mended", []):
            raise InputError(f"{out}: with the levels as they are now, bodies are set apart otherwise than in the stored ones; "
                             "choose another folder with --out")
        meshes = [*stored, *built[len(stored):]]
    for level, mesh in enumerate(meshes):
        check_fields(scene, mesh, level)
    check_start(meshes, obstacles, scene)
    return meshes, len(stored), obstacles, scene_diagonal(scene), mended


def _same_levels(run: Run, shot: Shot, last: int, method: str, prolongation: str) -> int:
    """How many of a run's levels, from the coarsest on, are still those of the shot; the others are to be simulated anew, up to `last`.

    Raises InputError, saying field by field what has changed, where that leaves none, or would drop a level that is not asked for.
    """
    require_scene(run.path, run.info)
    for name, now in (("method", method), ("prolongation", prolongation)):
        if run.info[name] != now:
            raise InputError(f"{run.path} was run with {name} {run.info[name]!r}, not {now!r}; choose another folder with --out")
    changed, same, levels_changed = differences_by_level(run.info["description"], shot.description())
    changed += [] if same else levels_changed
    if changed:
        more = f"; and {len(changed) - TOLD} more" if len(changed) > TOLD else ""
        raise InputError(f"{run.path} holds another scene ({'; '.join(changed[:TOLD])}{more}); choose another folder with --out")
    if len(run.levels) > shot.scene.levels:
        raise InputError(f"{run.path} holds {len(run.levels)} levels, the scene has {shot.scene.levels} now; choose another folder with --out")
    if same < len(run.levels) and last < len(run.levels) - 1:
        raise InputError(f"{run.path}: levels from {same} on have changed ({'; '.join(levels_changed[:TOLD])}); "
                         f"simulate them anew with levels up to {len(run.levels) - 1}, or choose another folder with --out")
    return min(same, len(run.levels))


def _open_writer(shot: Shot, out: Path, meshes, kept: int, obstacles, diagonal: float, method: str, prolongation: str,
                 mended: list[str]) -> RunWriter:
    scene = shot.scene
    velocities, drawn = [initial_velocity(scene, mesh) for mesh in meshes], _drawn_obstacles(scene, obstacles)
    if kept:
        writer = RunWriter.open(out)
        writer.keep_levels(kept)
        for level in range(len(writer.info["levels"]), len(meshes)):
            writer.add_level(meshes[level], velocities[level])
        description = shot.description()
        changed = {} if writer.info["description"] == jsonable(description) else {"parameters": dict(shot.parameters), "description": description}
        writer.update_info(steps=scene.steps, scene_file=str(shot.file), **changed)
    else:
        up = _up(scene)
        info = {"scene": shot.name, "dt": scene.dt, "steps": scene.steps, "method": method, "prolongation": prolongation,
                "scene_file": str(shot.file), "parameters": dict(shot.parameters), "description": shot.description(),
                "diagonal": diagonal, "versions": _versions(), **({"up": up} if up else {}), **({"mended": mended} if mended else {})}
        writer = RunWriter.create(out, info, meshes, [body.name for body in scene.bodies], velocities)
    writer.write_obstacles(drawn)
    return writer


def _up(scene: Scene) -> list[float] | None:
    """Against the first gravity, at t = 0: which way pictures have up; None without one."""
    gravity = next((load.acceleration for load in scene.loads if isinstance(load, Gravity)), None)
    return None if gravity is None else [-float(a) for a in (gravity(0.0) if callable(gravity) else gravity)]


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version(), "pdvol": version("pdvol")}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except ModuleNotFoundError:
            continue
    return found


def _drawn_obstacles(scene: Scene, geometry) -> list[dict]:
    """Obstacles as pictures need them, with their places over time where they move."""
    moving = sum(len(vertices) for (vertices, *_), o in zip(geometry, (o for o in scene.obstacles if isinstance(o, Rigid)), strict=True)
                 if not isinstance(o.motion, Still))
    if moving * (scene.steps + 1) > MOST_PLACES:
        raise InputError(f"{moving:,} vertices of moving obstacles over {scene.steps:,} steps are too many to keep; simulate fewer steps at a time")
    places = [_places(scene, geometry, number * scene.dt) for number in range(scene.steps + 1)]
    drawn, rigid = [], iter(geometry)
    for i, obstacle in enumerate(scene.obstacles):
        if isinstance(obstacle, Plane):
            start = {"point": np.asarray(obstacle.point, dtype=float), "normal": np.asarray(obstacle.normal, dtype=float)}
            moving = {key: np.array([place[i][key] for place in places]) for key in start if i in places[0]}
            drawn.append({"name": obstacle.name, "kind": "plane", **start, **moving})
            continue
        vertices, edges, faces = next(rigid)
        shape = {"kind": "mesh", "faces": faces} if vertices.shape[1] == 3 else {"kind": "polyline", "edges": edges}
        positions = {"positions": np.array([place[i]["vertices"] for place in places])} if i in places[0] else {}
        drawn.append({"name": obstacle.name, "vertices": vertices, **shape, **positions})
    return drawn


def _places(scene: Scene, geometry, time: float) -> dict[int, dict[str, np.ndarray]]:
    """Where the obstacles that move are at `time` [s], by their number."""
    found, rigid = {}, iter(geometry)
    for i, obstacle in enumerate(scene.obstacles):
        plane = isinstance(obstacle, Plane)
        corners = np.array([obstacle.point, np.add(obstacle.point, obstacle.normal)], dtype=float) if plane else next(rigid)[0]
        if isinstance(obstacle.motion, Still):
            continue
        x = moved(obstacle.motion, corners, time, f"{'plane' if plane else 'obstacle'} {obstacle.name!r}")
        found[i] = {"point": x[0], "normal": x[1] - x[0]} if plane else {"vertices": x}
    return found


class _Export:
    """level_N.xdmf of the levels being simulated, kept up to date for who watches them and for what a kill leaves. Used by rank 0."""

    def __init__(self, path: Path, scene: Scene, obstacles):
        self._path, self._scene, self._obstacles = path, scene, obstacles
        self._next: dict[int, float] = {}

    def write(self, level: int) -> None:
        """Writes one level's, as far as it is."""
        begin, run = time.monotonic(), open_run(self._path)
        try:
            more = SceneFields(self._scene, run, level, self._obstacles)
        except (ValueError, RuntimeError):  # a law of the user's own that knows two dimensions only: what it can show is no reason to stop
            more = nothing_more
        write_xdmf(run, level, self._path / f"level_{level}.xdmf", more)
        now = time.monotonic()
        self._next[level] = now + max(PAUSE, (now - begin) / SHARE)

    def follow(self, level: int) -> None:
        """The same after a state was stored, where it is due."""
        if time.monotonic() >= self._next.get(level, 0.0):
            with suppress(SimulationError):  # the next state will tell of a full disk
                self.write(level)


class _SharedWriter:
    """The run's writer on rank 0, called by all ranks together; its errors are everybody's."""

    def __init__(self, comm: MPI.Comm, open_writer: Callable[[], RunWriter], export: "_Export"):
        self.comm, self._writer, self._export = comm, None, export

        def take() -> None:
            self._writer = open_writer()

        on_root(comm, take)

    @property
    def path(self) -> Path:
        """The run folder; on rank 0."""
        return self._writer.path

    def call(self, name: str, *arguments, **details):
        """The result of one of the writer's methods, on every rank; a state that was stored is shown in level_N.xdmf, too, if it is time."""

        def call():
            result = getattr(self._writer, name)(*arguments, **details)
            if name == "write_state":
                self._export.follow(arguments[0])
            return result

        return on_root(self.comm, call)

    def read(self, level: int, what: str, step: int) -> np.ndarray:
        """`positions` or `velocities` of a stored state, on every rank."""
        return on_root(self.comm, lambda: getattr(open_run(self._writer.path).levels[level], what)(step))

    def record(self, level: int, step: int) -> dict:
        """The log's record of a stored step, on every rank; empty where there is none."""
        return on_root(self.comm, lambda: next((r for r in open_run(self._writer.path).levels[level].log if r.get("step") == step), {}))

    def export(self, level: int) -> None:
        """Writes level_N.xdmf."""
        on_root(self.comm, lambda: self._export.write(level))

    def finish(self, level: int) -> None:
        """Marks a level as done, with its export; a level that already is stays as it is."""

        def finish() -> None:
            if self._writer.info["levels"][level]["state"] != "done":
                self._export.write(level)
                self._writer.set_level_state(level, "done")

        on_root(self.comm, finish)

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()


def run_level(scene: Scene, hierarchy: Hierarchy, level: int, method: str, obstacles, diagonal: float, writer, progress: Watch | None) -> None:
    """Marches one level from where its store ends to the last step; `writer` is shared by the ranks, or a `Follower`. Collective."""
    done = writer.call("steps", level)
    if done > scene.steps:
        writer.finish(level)
        return
    mesh = hierarchy[level].mesh
    if done == 0:
        start = Start(0, mesh.points, initial_velocity(scene, mesh))
        writer.call("write_state", level, 0, start.positions)
    else:
        start = Start(done - 1, writer.read(level, "positions", done - 1), writer.read(level, "velocities", done - 1), writer.record(level, done - 1))
    writer.call("set_level_state", level, "running")
    march = _march(scene, hierarchy, level, method, obstacles, diagonal, partial(writer.read, level - 1), start)
    watcher = progress(level, scene.steps, start.step) if progress is not None else None
    try:
        for report in march:
            if report.behind > 0.0 and scene.obstacles:
                writer.call("write_late", level, report.step, _places(scene, obstacles, report.time - report.behind))
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


def _march(scene: Scene, hierarchy: Hierarchy, level: int, method: str, obstacles, diagonal: float, coarse: Callable[[str, int], np.ndarray],
           start: Start) -> Iterator[StepReport]:
    """The march of a method on a level; `coarse` gives `positions` or `velocities` of the level below at a step."""
    where = partial(coarse, "positions")
    if method == "embedded" and level > 0:
        mesh = hierarchy[level].mesh
        count = {"count": lambda positions, time: count_intersections(mesh, positions, obstacles, scene, time)} if scene.contact else {}
        return embedded(hierarchy.prolongation(level), where, level, start, scene.steps, scene.dt, **count)
    weight = scene.penalty.of(method) if level > 0 else 0.0
    guides = (guide(weight, scene.dt, hierarchy.prolongation(level), where),) if weight > 0.0 else ()
    problem = LevelProblem(scene, hierarchy[level], level, diagonal, obstacles, partial(hierarchy.coarse_weights, level),
                           level_materials(scene, hierarchy, level), guides)
    if method == "progressive" and level > 0:
        return progressive(problem, hierarchy.prolongation(level), partial(coarse, "velocities"), start, scene.steps)
    return direct(problem, start, scene.steps)
