"""What the verbs that simulate share: progress while they run, and a report at the end, both by one rank."""

import os
import sys
import time
from argparse import Namespace
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdvol.errors import LevelError
from pdvol.processes import cores
from pdvol.stages import stage

if TYPE_CHECKING:
    from pdvol.scene import Scene
    from pdvol.studio.workers import Worker


def this_rank() -> int:
    """The rank of this process; 0 where MPI is not loaded."""
    world = getattr(sys.modules.get("mpi4py.MPI"), "COMM_WORLD", None)  # none while another thread is loading MPI
    return world.rank if world is not None else 0


class Outputs:
    """The files that a command makes of a run: level_N.xdmf, and `picture.png` before it, as soon as the last level is
    done. A process draws it that loads its libraries meanwhile, where there is a core for it.

    Parameters
    ----------
    options : of the command, with `OUTPUTS`
    out : the run folder
    scene : of the run, where it is known
    """

    def __init__(self, options: Namespace, out: Path, scene: "Scene | None" = None):
        self.options, self.out, self._begun, self._before = options, out, options.no_picture, 0.0
        self._refused: LevelError | None = None
        beside = not self._begun and this_rank() == 0 and cores() > 1
        self._worker = _painter(_flat(scene)) if scene is not None and beside else None

    def simulate(self, run: Callable, *arguments: Any, replace: bool = False) -> None:
        """Calls `run_scene` or `refine_run` with the command's options. Where a finer level has no mesh, `report`
        raises its error. Collective.
        """
        from pdvol.runs.progress import Progress
        from pdvol.runs.runner import Execution
        from pdvol.store.folder import holds_run, last_write

        self._before = last_write(self.out)
        wavefront, xdmf = getattr(self.options, "wavefront", False), not self.options.no_xdmf
        how = Execution(
            Progress if this_rank() == 0 else None, wavefront, self.options.ranks, xdmf, replace, self._draw
        )
        try:
            run(*arguments, how=how)
        except LevelError as error:
            if error.level == 0 or not holds_run(self.out):  # what it may hold is an earlier command's
                raise
            self._refused = error

    def report(self) -> None:
        """Prints where the files are, what contact held back, and whether the finest level is the animation of level 0,
        on one rank. Raises LevelError where a finer level has no mesh.
        """
        if this_rank() == 0:
            self._report()
        if self._refused is not None:
            raise self._refused

    def _report(self) -> None:
        from pdvol.runs.run_metrics import last_animation
        from pdvol.runs.run_summary import event_lines, solver_lines
        from pdvol.store.folder import last_write
        from pdvol.store.reader import open_run

        self._draw()
        self._wait()
        run, options = open_run(self.out), self.options
        lost = (note for mesh in run.render_meshes for note in mesh.notes)
        notes = [f"note: {line}" for line in (*run.info.get("mended", []), *solver_lines(run), *lost)]
        if self._before == last_write(self.out):
            notes.append(f"{self.out}: all levels have all steps; nothing was left to simulate")
        made = (("level_N.xdmf", options.no_xdmf), ("picture.png", options.no_picture))
        *files, last = ["states", "log.jsonl", *(name for name, left_out in made if not left_out)]
        lines = [*notes, *event_lines(run), f"{self.out}: {', '.join(files)} and {last}", last_animation(run)]
        print("\n".join(line for line in lines if line is not None), file=sys.stderr)

    def _draw(self) -> None:
        """Draws, or has the process draw, once; not again what a picture shows."""
        from pdvol.store.folder import is_newer

        if self._begun or (is_newer(self.out / "picture.png", self.out) and not self.options.facets):
            return
        self._begun = True
        with suppress(RuntimeError):  # the process has ended
            if self._worker is not None and not self._worker.busy:
                words = ["render", str(self.out), *(["--facets"] if self.options.facets else [])]
                self._worker.start(words, Path(os.devnull))
                return
        self._draw_here()

    def _draw_here(self) -> None:
        from pdvol.store.reader import open_run
        from pdvol.studio.draw.picture import Shot, render

        render(open_run(self.out), self.out / "picture.png", shot=Shot(facets=self.options.facets))

    def _wait(self) -> None:
        if self._worker is None or not self._worker.busy:
            return
        with stage("drawing picture.png"):
            while (code := self._worker.poll()) is None:
                time.sleep(0.01)
        if code:
            self._draw_here()  # meets the same error


@cache
def _painter(flat: bool) -> "Worker":
    from pdvol.studio.workers import Worker

    return Worker("pdvol.studio.draw.flat" if flat else "pdvol.studio.draw.renderer")


def _flat(scene: "Scene") -> bool:
    """Whether a scene is 2D, by its first body's shape; files count as 3D."""
    shape = scene.bodies[0].shape
    shape = shape[0] if isinstance(shape, tuple) else shape
    points: Any = getattr(shape, "points", getattr(shape, "vertices", None))
    return getattr(points, "shape", ())[1:] == (2,)
