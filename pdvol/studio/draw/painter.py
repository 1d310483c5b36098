"""A process that draws pictures of 3D runs. It loads VTK while the run is simulated, and draws beside exports."""

import subprocess
import sys
from functools import cache
from pathlib import Path

from pdvol.processes import die_with_parent, without_launcher

DONE = "drawn"
"""The process's answer to each run folder of which it has drawn `picture.png`; any other one is that it could not."""


class Painter:
    """The process, which ends with this one."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__],
            env=without_launcher(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # what fails is drawn again, and says why
            text=True,
            start_new_session=True,  # Ctrl-C is for the process that simulates
            preexec_fn=die_with_parent,
        )
        self._asked = 0

    def begin(self, run: Path) -> None:
        """Has it draw `picture.png` of a run."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(f"{run.resolve()}\n")
            self._process.stdin.flush()
        except OSError:  # it has ended
            return
        self._asked += 1

    def finish(self) -> bool:
        """Whether it has drawn what it was last asked for, for which this waits."""
        assert self._process.stdout is not None
        answer = ""
        while self._asked:
            answer, self._asked = self._process.stdout.readline().strip(), self._asked - 1
        return answer == DONE


@cache
def painter() -> Painter:
    """The one of this process."""
    return Painter()


def _draw(path: str) -> str:
    from pdvol.store.reader import open_run
    from pdvol.studio.draw.picture import render

    try:
        render(open_run(path), Path(path, "picture.png"))
    except Exception:  # whoever asked draws itself, and meets the same error
        return "failed"
    return DONE


def _work() -> None:
    import pyvista as pv

    die_with_parent()
    pv.Plotter(off_screen=True, window_size=(8, 8)).render()  # loads the graphics driver
    for line in sys.stdin:
        print(_draw(line.rstrip("\n")), flush=True)


if __name__ == "__main__":
    _work()
