"""What the verbs that simulate share: progress while they run, and a report at the end, both by one rank."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from pdvol.errors import LevelError

if TYPE_CHECKING:
    from pdvol.runs.level_run import Watch


def this_rank() -> int:
    """The rank of this process; 0 where MPI is not loaded."""
    mpi = sys.modules.get("mpi4py.MPI")
    world = getattr(mpi, "COMM_WORLD", None)  # none while another thread is loading MPI
    return world.rank if world is not None else 0


def progress_report() -> "Watch | None":
    """Progress of each level on standard error, on one rank; None on the others."""
    from pdvol.runs.progress import Progress

    return (lambda level, total, done: Progress(level, total, done=done)) if this_rank() == 0 else None


@contextmanager
def reported(
    out: Path, drawn: bool = True, exported: bool = True, lines: Callable[[], Iterable[str]] = tuple
) -> Iterator[None]:
    """Print `lines()`, and `report_run`, of the run that the block makes. Where a finer level has no mesh, its error is
    raised after that.
    """
    from pdvol.store.folder import holds_run

    refused = None
    try:
        yield
    except LevelError as error:
        if not holds_run(out):
            raise
        refused = error
    for line in lines():
        print(line)
    report_run(out, drawn, exported)
    if refused is not None:
        raise refused


def report_run(out: Path, drawn: bool = True, exported: bool = True) -> None:
    """Draw `picture.png` of a finished run if `drawn`, and print where its files are, what contact held back, and
    whether the finest level is the animation of level 0, on one rank. `exported` says that level_N.xdmf is there.
    """
    if this_rank() != 0:
        return
    from pdvol.runs.run_metrics import last_animation
    from pdvol.runs.run_summary import held_back_lines, solver_lines
    from pdvol.store.reader import open_run

    run = open_run(out)
    if drawn:
        from pdvol.studio.draw.picture import render

        render(run, out / "picture.png")
    lost = (note for mesh in run.render_meshes for note in mesh.notes)
    notes = [f"note: {line}" for line in (*run.info.get("mended", []), *solver_lines(run), *lost)]
    for line in (*notes, *held_back_lines(run)):
        print(line, file=sys.stderr)
    files = ["states", "log.jsonl", *(["level_N.xdmf"] if exported else []), *(["picture.png"] if drawn else [])]
    print(f"{out}: {', '.join(files[:-1])} and {files[-1]}", file=sys.stderr)
    animation = last_animation(run)
    if animation is not None:
        print(animation, file=sys.stderr)
