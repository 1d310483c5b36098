"""What the verbs that simulate share: progress while they run, and a report at the end, both by one rank."""

import os
import sys
import time
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdvol.processes import cores
from pdvol.stages import stage

if TYPE_CHECKING:
    from pdvol.runs.level_run import Watch
    from pdvol.scene import Scene
    from pdvol.studio.wedge.worker import Worker


def this_rank() -> int:
    """The rank of this process; 0 where MPI is not loaded."""
    mpi = sys.modules.get("mpi4py.MPI")
    world = getattr(mpi, "COMM_WORLD", None)  # none while another thread is loading MPI
    return world.rank if world is not None else 0


def progress_report() -> "Watch | None":
    """Progress of each level on standard error, on one rank; None on the others."""
    from pdvol.runs.progress import Progress

    return (lambda level, total, done: Progress(level, total, done=done)) if this_rank() == 0 else None


class Picture:
    """`picture.png` of a run, drawn as soon as its last level is done: of 3D scenes by a process that loads VTK before,
    where there is a core for it.

    Parameters
    ----------
    out : the run folder
    wanted : without it nothing is drawn
    scene : of the run, where it is known
    """

    def __init__(self, out: Path, wanted: bool, scene: "Scene | None" = None):
        self.out, self.wanted, self._begun = out, wanted, False
        beside = wanted and scene is not None and this_rank() == 0 and cores() > 1 and not _flat(scene)
        self._worker = _painter() if beside else None

    def begin(self) -> None:
        """Draws it, or has it drawn."""
        self._begun = True
        if self._worker is not None and self._worker.alive:
            self._worker.start(["render", str(self.out)], Path(os.devnull))
        elif self.wanted:
            self._draw()

    def finish(self) -> None:
        """Waits until it is drawn."""
        if not self._begun:
            self.begin()
        if self._worker is not None and self._worker.busy:
            with stage("drawing picture.png"):
                while (code := self._worker.poll()) is None:
                    time.sleep(0.01)
            if code:
                self._draw()  # meets the same error

    def _draw(self) -> None:
        from pdvol.store.reader import open_run
        from pdvol.studio.draw.picture import render

        render(open_run(self.out), self.out / "picture.png")


@cache
def _painter() -> "Worker":
    from pdvol.studio.wedge.worker import Worker

    return Worker("pdvol.studio.draw.renderer")


def _flat(scene: "Scene") -> bool:
    """Whether a scene is 2D, by its first body's shape; files count as 3D."""
    shape = scene.bodies[0].shape
    shape = shape[0] if isinstance(shape, tuple) else shape
    points: Any = getattr(shape, "points", getattr(shape, "vertices", None))
    return getattr(points, "shape", ())[1:] == (2,)


def report_run(picture: Picture, exported: bool = True) -> None:
    """Print where a finished run's files are, its picture among them, what contact held back, and whether the finest
    level is the animation of level 0, on one rank. `exported` says that level_N.xdmf is there.
    """
    if this_rank() != 0:
        return
    from pdvol.runs.run_metrics import last_animation
    from pdvol.runs.run_summary import held_back_lines, solver_lines
    from pdvol.store.reader import open_run

    picture.finish()
    out = picture.out
    run = open_run(out)
    lost = (note for mesh in run.render_meshes for note in mesh.notes)
    notes = [f"note: {line}" for line in (*run.info.get("mended", []), *solver_lines(run), *lost)]
    for line in (*notes, *held_back_lines(run)):
        print(line, file=sys.stderr)
    files = [
        "states",
        "log.jsonl",
        *(["level_N.xdmf"] if exported else []),
        *(["picture.png"] if picture.wanted else []),
    ]
    print(f"{out}: {', '.join(files[:-1])} and {files[-1]}", file=sys.stderr)
    animation = last_animation(run)
    if animation is not None:
        print(animation, file=sys.stderr)
