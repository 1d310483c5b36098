"""How right previews are: the old defaults (implicit Euler, linear elements, no feedback) beside the new ones.

    ./run python -m benchmarks.preview [ape,noodles,distances,drift] [--out runs/preview]
    ./run python -m benchmarks.preview --page

- ape: how high the thrown ape comes on each level, alone and refined.
- noodles: how far slices are bent on each level, and on level 0 over level 2.
- distances: between the levels of the leaf sheep's plant, the rope and the twisted bar.
- drift: of refined levels from level 0, with and without feedback.

`--page` makes the films, the curves and the table of docs/how_right.md. Finished runs in `--out` are used again.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.common import process
from benchmarks.common.process import Mistake
from benchmarks.common.tables import number, table
from benchmarks.preview import page
from benchmarks.preview.shots import DEFAULTS, SHOTS, TRUE_DT, demo, drifts, from_level_0, rises, stored
from pdvol import PdvolError
from pdvol.runs.scene_file import load_module, load_shot
from pdvol.store.reader import Run


def main(words: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("preview", __doc__)
    parser.add_argument("parts", nargs="?", default=",".join(PARTS), help=f"some of {', '.join(PARTS)} (default: all)")
    parser.add_argument("--page", action="store_true", help="make docs/how_right.md's films, curves and table instead")
    parser.add_argument("--out", type=Path, default=Path("runs/preview"), help="where runs are kept")
    options = parser.parse_args(words)
    try:
        if options.page:
            page.write(options.out)
            return 0
        wanted = options.parts.split(",")
        for part in wanted:
            if part not in PARTS:
                raise Mistake(f"there is no part {part!r}; there are {', '.join(PARTS)}")
        for part in wanted:
            print(f"{PARTS[part](options.out)}\n", flush=True)
    except (Mistake, OSError, PdvolError) as error:
        print(f"benchmarks.preview: {error}", file=sys.stderr)
        return 2
    return 0


def ape(out: Path) -> str:
    """How high the thrown ape's centre and its highest point come: levels alone and refined, old and new defaults, and
    the truth, the finest smoothed mesh with BDF2 at `TRUE_DT`. The ape is supported: it has no feedback.
    """
    finest, kinds = SHOTS["ape"].finest, ("old", "new, no feedback")
    columns = [stored(out, "ape", method, **DEFAULTS[name]) for name in kinds for method in ("direct", "progressive")]
    true = stored(out, "ape", "direct", (finest, finest), **DEFAULTS["new, no feedback"], dt=TRUE_DT)
    most = lambda run, level: 1e3 * rises(run, level).max(axis=0)
    truth = most(true, finest)
    rows = []
    for measure, what in enumerate(("centre", "highest point")):
        found = np.array([[most(run, level)[measure] for level in range(finest + 1)] for run in columns])
        for level in range(finest + 1):
            cells = [f"{value:.0f} ({value / truth[measure]:.3f})" for value in found[:, level]]
            rows.append([what, str(level), *cells, f"{truth[measure]:.0f}"])
        apart = np.abs(1.0 - found[:, 0] / found[:, finest])
        rows.append([what, f"level 0 apart from level {finest}", *(f"{value:.1%}" for value in apart), ""])
    head = [f"{name}, {kind} [mm] (over the truth)" for name in ("old", "new") for kind in ("alone", "refined")]
    return table(["ape rises: what", "level", *head, "truth [mm]"], rows)


def noodles(out: Path) -> str:
    """How far slices are bent [degrees] on each level, and on level 0 over the finest level."""
    turns, finest = load_module(demo("noodles")).turns, SHOTS["noodles"].finest
    rows = []
    for name in ("old", "new"):
        run = stored(out, "noodles", **DEFAULTS[name])
        bends = [float(turns(run, level).mean()) for level in range(finest + 1)]
        rows.append([name, *(f"{bend:.1f}" for bend in bends), f"{bends[0] / bends[-1]:.0%}"])
    head = [f"level {level} [deg]" for level in range(finest + 1)]
    return table(["noodles: defaults", *head, f"level 0 over level {finest}"], rows)


def distances(out: Path) -> str:
    """Distance of each level from level 0 [mm]: mean over the shot, and largest."""
    rows = []
    for name in ("leaf_sheep", "rope", "twist"):
        body = SHOTS[name].body
        found = [from_level_0(stored(out, name, **settings), body) for settings in DEFAULTS.values()]
        for level in found[0]:
            cells = [f"{number(1e3 * each[level].mean())} ({number(1e3 * each[level].max())})" for each in found]
            rows.append([f"{name}, {body}" if body else name, span(name), str(level), *cells])
    head = ["scene", "span [s]", "level", *(f"{name}: mean (largest) [mm]" for name in DEFAULTS)]
    return table(head, rows)


def drift(out: Path) -> str:
    """Drift of each level from level 0: largest, and at the end; centre [mm] and turn [degrees]."""
    rows = []
    for name in ("spike", "drop", "jelly_bowl", "leaf_sheep"):
        runs = [stored(out, name, **settings) for settings in DEFAULTS.values()]
        found = [drifts(run) for run in runs]
        for level in found[0]:
            cells = []
            for each in found:
                centre, turn = (1e3, 1.0) * each[level].max(axis=0), each[level][-1]
                cells.append(f"{number(centre[0])}, {number(1e3 * turn[0])}; {number(centre[1])}, {number(turn[1])}")
            newton = ", ".join(str(iterations(run, level)) for run in runs)
            rows.append([name, span(name), str(level), *cells, newton])
    cell = "centre largest, end [mm]; turn largest, end [deg]"
    return table(["scene", "span [s]", "level", *(f"{name}: {cell}" for name in DEFAULTS), "Newton"], rows)


def span(name: str) -> str:
    """What is run of a shot [s]."""
    shot = SHOTS[name]
    scene = load_shot(demo(name), dict(shot.settings)).scene
    return f"{shot.steps * scene.dt:g} of {scene.steps * scene.dt:g}"


def iterations(run: Run, level: int) -> int:
    """Newton iterations of all steps."""
    return int(np.sum([record["newton_iterations"] for record in run.levels[level].log]))


PARTS: dict[str, Callable[[Path], str]] = {"ape": ape, "noodles": noodles, "distances": distances, "drift": drift}

if __name__ == "__main__":
    sys.exit(main())
