"""How right is a preview? A swinging bar and a thrown ape by old and new integrators and elements, beside the truth.

    ./run python -m benchmarks.preview [--out runs/preview]

It makes the films, the curves and the table of docs/how_right.md. Finished runs in `--out` are used again.
"""

import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial import cKDTree

import pdvol
from benchmarks.common.figures import over_time, panels
from benchmarks.common.process import REPOSITORY
from benchmarks.common.study import command
from benchmarks.common.tables import Page, table
from benchmarks.time_order.__main__ import cantilever
from demos.gallery.film import FRAMES_PER_SECOND, fit_film, fit_picture
from pdvol.geometry.level_mesh import lumped_masses
from pdvol.runs.scene_file import load_shot
from pdvol.scene import Scene
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.draw.camera import cameras_of_run
from pdvol.studio.draw.compose import Grid, Pane, Pen, frames, renderer_by
from pdvol.studio.draw.film import film_steps, write_film
from pdvol.studio.draw.layout import FAINT_INK
from pdvol.studio.shown import PALETTE

DOCS, PICTURES = REPOSITORY / "docs" / "how_right.md", REPOSITORY / "docs" / "pictures"
DT, TRUE_DT = 0.01, 0.0025
"""Time step of both shots, and of what they are compared with [s]: BDF2's error is a sixteenth of that at `DT`."""
EVERY = round(DT / TRUE_DT)
KINDS = {
    f"{time}, {space}": {"integrator": integrator, "elements": space, "feedback": 0.0}
    for time, integrator in (("implicit Euler", "implicit_euler"), ("BDF2", "bdf2"))
    for space in ("linear", "smoothed")
}
NEW = "BDF2, smoothed"
"""The kind of the truth."""
FINEST, SECONDS = {"bar": 2, "ape": 3}, {"bar": 3.0, "ape": 0.8}
"""Finest levels, and lengths [s]: the bar swings about once a second. Level 0 and the finest one are shown."""
CELLS, HEADER = {"bar": (232, 190), "ape": (232, 300)}, 40
"""Pixels of a picture in a film, and of the text above it."""
FRAME = {"bar": DT, "ape": 1.0 / FRAMES_PER_SECOND}
"""Seconds that a step lasts in the film."""
LABELS = {"bar": "height of the tip [m]", "ape": "rise of the centre [m]"}
TRUTH_INK = "#3b3f46"


@command("preview", __doc__, {"--out": {"type": Path, "default": Path("runs/preview"), "help": "where runs are kept"}})
def main(options) -> None:
    """Makes everything; runs are kept in the folder `--out`."""
    lines: dict[str, list[float]] = {}
    for name, lines_of in (("bar", bar_lines), ("ape", ape_lines)):
        runs = {kind: stored(options.out, name, **settings) for kind, settings in KINDS.items()}
        true = stored(options.out, name, true=True, **KINDS[NEW], dt=TRUE_DT)
        fit_film(write_film(PICTURES / f"how_right_{name}.webp", film(name, runs, true), FRAMES_PER_SECOND))
        curves(name, runs, true)
        lines |= lines_of(runs, true)
    text = table(["[mm]", *KINDS, "truth"], [[key, *(f"{1e3 * x:.0f}" for x in row)] for key, row in lines.items()])
    Page(DOCS, "preview", "table").write(text)
    print(text)


def scene_of(name: str) -> Scene:
    """The thrown ape, or the bar of `time_order`, ten times as stiff."""
    if name == "ape":
        return load_shot(REPOSITORY / "demos" / "ape.py").scene
    scene = cantilever()
    (body,) = scene.bodies
    return replace(scene, bodies=(replace(body, material=replace(body.material, young=1e6)),))


def stored(out: Path, name: str, true: bool = False, **settings) -> Run:
    """The run of a scene with settings, from `out` where it is finished there: all levels, or the finest one alone."""
    scene, finest = replace(scene_of(name), **settings), FINEST[name]
    method, first = ("direct", finest) if true else ("progressive", 0)
    folder = out / "_".join([name, method, *map(str, settings.values())])
    there = (folder / "run.json").exists()
    return pdvol.run(scene, folder, (first, finest), method, steps=round(SECONDS[name] / scene.dt), resume=there)


# ---- figures


def heights(name: str, run: Run, level: RunLevel) -> np.ndarray:
    """At multiples of `DT`, the height of the middle of the bar's free end, or how far the ape's centre has risen
    [m].
    """
    if name == "bar":
        end = np.argmin(np.linalg.norm(level.rest - [level.rest[:, 0].max(), np.mean(level.rest[:, 1])], axis=1))
        return np.array([x[end, 1] for x in states(run, level)])
    volumes = lumped_masses(level.mesh, np.ones(len(level.cells)))
    centres = np.array([volumes @ x[:, 2] / volumes.sum() for x in states(run, level)])
    return centres - centres[0]


def states(run: Run, level: RunLevel) -> Iterator[np.ndarray]:
    """Positions (n, d) [m] of a level at multiples of `DT`."""
    return (level.positions(step) for step in range(0, level.steps, round(DT / run.dt)))


def bar_lines(runs: Mapping[str, Run], true: Run) -> dict[str, list[float]]:
    """Lines of the table [m]: distance from the truth, and how far the tip swings in the last second."""
    lines: dict[str, list[float]] = {}
    (alone,), shown = true.levels[-1:], (0, FINEST["bar"])
    for level in shown:
        same = cKDTree(alone.rest).query(runs[NEW].levels[level].rest)[1]  # a coarse grid's vertices are among these
        right = np.array(list(states(true, alone)))[:, same]
        squares = [((np.array(list(states(run, run.levels[level]))) - right) ** 2).sum(axis=2) for run in runs.values()]
        lines[f"bar, level {level}: from the truth, mean"] = [*(np.sqrt(s.mean(axis=1)).mean() for s in squares), 0.0]
    for level in shown:
        both = [*((run, run.levels[level]) for run in runs.values()), (true, alone)]
        last = [heights("bar", *one)[-round(1.0 / DT) :] for one in both]
        lines[f"bar, level {level}: the tip swings in the last second by"] = [np.ptp(tip) for tip in last]
    return lines


def ape_lines(runs: Mapping[str, Run], true: Run) -> dict[str, list[float]]:
    """Lines of the table [m]: how high the centre comes, and how far its height is from the truth's."""
    rises, errors = {}, {}
    right = heights("ape", true, true.levels[-1])
    for level in (0, FINEST["ape"]):
        found = [heights("ape", run, run.levels[level]) for run in runs.values()]
        rises[f"ape, level {level}: the centre rises by"] = [each.max() for each in (*found, right)]
        apart = [np.sqrt(((each - right) ** 2).mean()) for each in (*found, right)]
        errors[f"ape, level {level}: its height from the truth's, root mean square"] = apart
    return rises | errors


# ---- pictures


def film(name: str, runs: Mapping[str, Run], true: Run) -> Iterator[Image.Image]:
    """Frames with a column a kind, a row a level, and the truth in the last column."""
    cell, last = CELLS[name], round(SECONDS[name] / DT)
    # The truth moves furthest: all fits into its picture.
    (camera, *_) = cameras_of_run(true, true.levels[-1:], range(0, EVERY * last + 1, EVERY), aspect=cell[0] / cell[1])
    panes = [
        pane(kind, run, run.levels[-1 if run is true else index], run is true)
        for index in (0, FINEST[name])
        for kind, run in (*runs.items(), ("truth", true))
    ]
    steps = film_steps(0, last, FRAME[name], FRAMES_PER_SECOND)
    moments = [[(step * (EVERY if pane.run is true else 1), None) for pane in panes] for step in steps]
    return frames(renderer_by(camera, cell), Grid(len(panes), len(runs) + 1, cell, above=HEADER), panes, moments)


def pane(kind: str, run: Run, level: RunLevel, true: bool) -> Pane:
    """A place of the film."""

    def words(pen: Pen, step: int) -> None:
        pen.text(10, 14 - HEADER, kind, 15)
        note = f"{step * run.dt:.2f} s" if true else f"level {level.index}, {len(level.rest):,} vertices"
        pen.text(10, 31 - HEADER, note, 13, FAINT_INK)

    return Pane(run, level, words)


def curves(name: str, runs: Mapping[str, Run], true: Run) -> None:
    """A panel a kind: a line a level, and the truth; one legend below them."""
    figure, (axes,) = panels((12.0, 3.3), 1, len(runs), sharey=True)
    right = heights(name, true, true.levels[-1])
    times, out = DT * np.arange(len(right)), PICTURES / f"how_right_{name}.png"
    for one, (kind, run) in zip(axes, runs.items(), strict=True):
        for level in run.levels:
            one.plot(times, heights(name, run, level), color=PALETTE[level.index], label=f"level {level.index}")
        one.plot(times, right, color=TRUTH_INK, linestyle="--", label="truth")
        over_time(one, kind, y=LABELS[name] if one is axes[0] else "", legend=False)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=9, fontsize=8, frameon=False)
    figure.savefig(out, dpi=110)
    fit_picture(out, colours=256)  # of fewer, levels are grey


if __name__ == "__main__":
    sys.exit(main())
