"""The classic stress tests of contact (scenes.py) under a limit of time each, and one table of the outcomes.

    ./run python -m benchmarks.stress [--scenes chain,erleben] [--minutes 20] [--out runs/stress] [--pictures]

Scenes already in the folder --out stay in the table. Each runs in a process of its own until its end, or until its
minutes of CPU time are over. `pdvol verify` checks every state. The exit code is 0 when every scene came to its end,
its time limit or a named error and no state is wrong, 1 otherwise.
"""

import sys
from pathlib import Path

from benchmarks.common import trials
from benchmarks.common.process import REPOSITORY
from benchmarks.common.rows import NAMES, STRESS
from benchmarks.common.study import command
from benchmarks.stress import scenes
from demos.gallery.film import TILE, place_tile
from pdvol.store.reader import open_run
from pdvol.studio.draw.compose import Grid, Pane, composed
from pdvol.studio.draw.views import STANDARD_SHOT


@command(
    "stress",
    __doc__,
    {
        "--scenes": {**NAMES, "help": "by name or by its beginning (default: all)"},
        "--minutes": {"type": float, "default": 20.0, "help": "of CPU time, for each scene (default: 20)"},
        "--out": {"type": Path, "default": REPOSITORY / "runs" / "stress", "help": "for the table and pictures"},
        "--pictures": {"action": "store_true", "help": "pictures.png, with the last moment of each scene"},
    },
)
def main(options) -> int:
    """Runs the command; returns its exit code."""
    keep = (lambda name, path: draw(name, path, options.out / "pictures.png")) if options.pictures else (lambda *_: "")
    return trials.run_all("stress", STRESS, scenes.SCENES, options, 60.0 * options.minutes, keep)


def draw(name: str, path: Path, sheet: Path) -> str:
    """Puts the last moment of the finest level that has begun on a contact sheet; there is nothing to note."""
    run = open_run(path)
    level = [level for level in run.levels if level.steps][-1]
    tile = next(composed([Pane(run, level)], [level.steps - 1], STANDARD_SHOT, Grid(1, 1, TILE)))
    place_tile(tile, name, list(scenes.SCENES), sheet)
    return ""


if __name__ == "__main__":
    sys.exit(main())
