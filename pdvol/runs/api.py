"""`pdvol.run`: a scene made in memory, simulated from a script or a notebook."""

import atexit
import os
import shutil
import tempfile
import weakref
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any, TextIO

from mpi4py import MPI

from pdvol.errors import InputError, PdvolError
from pdvol.parallel import on_root
from pdvol.runs.level_run import Watch
from pdvol.runs.march import checked_scene, levels_asked
from pdvol.runs.notebook_text import progress_stream
from pdvol.runs.progress import Calls, Progress
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import Shot
from pdvol.runs.stage_lines import StageLines
from pdvol.scene import Scene
from pdvol.stages import reported_to
from pdvol.store.reader import Run, open_run


def run(
    scene: Scene,
    out: str | Path | None = None,
    levels: int | tuple[int, int] | range | str | None = None,
    method: str = "progressive",
    prolongation: str = "barycentric",
    steps: int | None = None,
    resume: bool = False,
    progress: bool | Callable[[dict], Any] | None = None,
    comm: MPI.Comm | None = None,
) -> Run:
    """Simulate a scene, coarse to fine. Collective.

    Parameters
    ----------
    scene : Scene
    out : run folder, a new one, or with `resume` one of the same scene. Without it the run lives in a temporary folder,
        which is removed with the `Run` object or at the end of the process. Several ranks need a folder.
    levels : which levels: `2` stands for 0 to 2, and so do `(0, 2)` (both included), `range(3)` and `"0:2"`. All when
        None. Levels from above 0 on refine the run in `out`.
    method : "progressive", "direct", "tracks" or "embedded"
    prolongation : how a level's motion is carried to the next finer one: "barycentric", "biharmonic" or "phong"
    steps : number of time steps, instead of the scene's
    resume : go on with the run in `out`: finished steps are kept, further levels are added
    progress : True shows a bar per level (in a notebook or on a terminal) or a line per step. Before them it shows what
        takes long, as meshing. A function is called with the log record (a dict) of each step, on rank 0
    comm : MPI communicator; the world when None

    Returns
    -------
    Run
        As `pdvol.open_run(out)` gives it.

    Raises
    ------
    InputError
        Something in the arguments, the scene, its meshes or the folder is unfit.
    MeshError
        No mesh came out for a level. Coarser ones are kept as after a ConvergenceError.
    ConvergenceError
        A step could not be solved. Everything up to the last good step is kept, in a temporary folder until the process
        ends; a note of the error names the folder.
    """
    comm = MPI.COMM_WORLD if comm is None else comm
    scene = checked_scene("run", scene, steps)
    if not (out is None or isinstance(out, str | os.PathLike)):
        raise InputError(f"out = {out!r} must be the path of a folder")
    if not (progress is None or isinstance(progress, bool) or callable(progress)):
        raise InputError(f"progress = {progress!r} must be True, None or a function of a step's record")
    first, last = levels_asked(levels)
    if out is None and comm.size > 1:
        raise InputError("several ranks need a run folder: pdvol.run(scene, out=...)")
    if out is None and resume:
        raise InputError("resume needs the folder of a stored run: pdvol.run(scene, out=..., resume=True)")
    folder = Path(tempfile.mkdtemp(prefix="pdvol_")) if out is None else Path(out)
    try:
        stream = progress_stream() if progress is True and comm.rank == 0 else None
        watch = _watch(progress, comm, stream)
        with nullcontext() if stream is None else reported_to(StageLines(stream)):
            how = Execution(watch, comm=comm)
            run_scene(Shot(None, {}, scene), folder, first, last, method, prolongation, resume, how)
    except BaseException as error:
        if out is None:
            _keep_or_remove(folder, error)
        raise
    on_root(comm, lambda: None)  # all ranks read what one has written
    stored = open_run(folder)
    if out is None:
        weakref.finalize(stored, _remove, folder, os.getpid())
    return stored


def _watch(progress: bool | Callable[[dict], Any] | None, comm: MPI.Comm, stream: TextIO | None) -> Watch | None:
    """What `Execution` takes for this `progress`, which is shown on the stream where there is one."""
    if not callable(progress):
        return None if stream is None else partial(Progress, stream=stream)

    def call(record: Mapping) -> None:
        progress(dict(record))

    return lambda level, total, done: Calls(lambda record: on_root(comm, partial(call, record)))


def _keep_or_remove(folder: Path, error: BaseException) -> None:
    """After a failure: finished steps stay until the process ends, and the error names their folder."""
    try:
        kept = any(level.steps > 0 for level in open_run(folder).levels)
    except PdvolError:
        kept = False
    if not kept:
        shutil.rmtree(folder, ignore_errors=True)
        return
    error.add_note(f"finished steps are kept until this process ends: pdvol.open_run({str(folder)!r})")
    atexit.register(partial(_remove, folder, os.getpid()))


def _remove(folder: Path, process: int) -> None:
    """Removes a temporary run; not in a process that was forked from the one that made it."""
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)
