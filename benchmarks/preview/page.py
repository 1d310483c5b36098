"""The films, curves and table of docs/how_right.md: a swinging bar and the thrown ape, by both integrators and both
kinds of elements, beside the truth.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from PIL import Image

import pdvol
from benchmarks.common.figures import over_time, panels
from benchmarks.common.process import REPOSITORY
from benchmarks.common.tables import Page, table
from benchmarks.preview.shots import DT, FINEST, KINDS, STEPS, TRUE_DT, rises, stored
from benchmarks.time_order.__main__ import cantilever, grid
from demos.gallery.film import FRAMES_PER_SECOND, fit_film, fit_picture
from pdvol.geometry.level_mesh import boundary_facets
from pdvol.store.reader import Run
from pdvol.studio.draw.camera import cameras_of_run
from pdvol.studio.draw.compose import Grid, Pane, Pen, frames, renderer_by
from pdvol.studio.draw.film import film_steps, write_film
from pdvol.studio.draw.layout import FAINT_INK, INK
from pdvol.studio.shown import PALETTE

DOCS, PICTURES = REPOSITORY / "docs" / "how_right.md", REPOSITORY / "docs" / "pictures"
BAR_SECONDS, BAR_YOUNG = 3.0, 1e6
"""How long the bar swings [s], about a second a swing; and its stiffness [Pa]."""
BAR_CUTS = ((10, 2), (20, 4), (40, 8))
"""Squares along and across the bar on its levels, as `time_order.cantilever` has them."""
BAR_SHOWN, APE_SHOWN = (0, 2), (0, 3)
"""Levels in the films and the table."""
CELL, HEADER = (232, 300), 40
"""Pixels of a picture of the ape, and of the text above it."""
TRUTH_INK = "#3b3f46"


def write(out: Path) -> None:
    """Writes everything; runs of the ape are kept in the folder `out`."""
    bars, true_bar = bar_states()
    apes = {kind: stored(out, **settings) for kind, settings in KINDS.items()}
    true_ape = stored(out, "direct", FINEST, **KINDS["BDF2, smoothed"], dt=TRUE_DT)
    for name, film in (("bar", film_of_bars(bars, true_bar)), ("ape", film_of_apes(apes, true_ape))):
        fit_film(write_film(PICTURES / f"how_right_{name}.webp", film, FRAMES_PER_SECOND))
    truth = rises(true_ape, FINEST)[:: round(DT / TRUE_DT)]
    heights = {kind: {level: rises(run, level) for level in range(FINEST + 1)} for kind, run in apes.items()}
    curves(PICTURES / "how_right_bar.png", "height of the tip [m]", tips(bars), tip(true_bar))
    curves(PICTURES / "how_right_ape.png", "rise of the centre [m]", heights, truth)
    lines = bar_lines(bars, true_bar) | ape_lines(heights, truth)
    rows = [[label, *(f"{1e3 * value:.0f}" for value in values)] for label, values in lines.items()]
    text = table(["[mm]", *apes, "truth"], rows)
    Page(DOCS, "preview", "table").write(text)
    print(text)


# ---- the bar


def bar_states(seconds: float = BAR_SECONDS) -> tuple[dict[str, list[np.ndarray]], np.ndarray]:
    """Of each kind, the positions (steps, n, 2) [m] of each level at multiples of `DT`; and those of the truth: the
    finest level alone at `TRUE_DT`.
    """
    scene = cantilever()
    (body,) = scene.bodies
    scene = replace(scene, bodies=(replace(body, material=replace(body.material, young=BAR_YOUNG)),))
    steps, finest, every = round(seconds / DT), len(BAR_CUTS) - 1, round(DT / TRUE_DT)
    found: dict[str, list[np.ndarray]] = {}
    for kind, settings in KINDS.items():
        levels: list[list[np.ndarray]] = [[] for _ in BAR_CUTS]
        for step in pdvol.march(replace(scene, **settings), steps=steps):
            levels[step.level].append(step.positions)
        found[kind] = [np.array(positions) for positions in levels]
    true = replace(scene, **KINDS["BDF2, smoothed"], dt=TRUE_DT)
    alone = pdvol.march(true, levels=(finest, finest), method="direct", steps=steps * every)
    return found, np.array([step.positions for step in alone if step.step % every == 0])


def tip(x: np.ndarray) -> np.ndarray:
    """Height (steps,) [m] of the middle of a bar's free end."""
    columns, rows = next(cuts for cuts in BAR_CUTS if (cuts[0] + 1) * (cuts[1] + 1) == x.shape[1])
    return x[:, (rows // 2 + 1) * (columns + 1) - 1, 1]


def tips(bars: Mapping[str, Sequence[np.ndarray]]) -> dict[str, dict[int, np.ndarray]]:
    """kind -> level -> height of the tip (steps,) [m]."""
    return {kind: {level: tip(x) for level, x in enumerate(levels)} for kind, levels in bars.items()}


def of_level(truth: np.ndarray, level: int) -> np.ndarray:
    """The truth (steps, n, 2) at the vertices of a level, which are among its own."""
    columns, rows = BAR_CUTS[-1]
    every = columns // BAR_CUTS[level][0]
    places = truth.reshape(len(truth), rows + 1, columns + 1, 2)[:, ::every, ::every]
    return places.reshape(len(truth), -1, 2)


def bar_lines(bars: Mapping[str, Sequence[np.ndarray]], truth: np.ndarray) -> dict[str, list[float]]:
    """Lines of the table [m]: distance from the truth, and how far the tip swings in the last second."""
    lines: dict[str, list[float]] = {}
    for level in BAR_SHOWN:
        true = of_level(truth, level)
        squares = [((levels[level] - true) ** 2).sum(axis=2) for levels in bars.values()]
        lines[f"bar, level {level}: from the truth, mean"] = [*(np.sqrt(s.mean(axis=1)).mean() for s in squares), 0.0]
    for level in BAR_SHOWN:
        last = [tip(x)[-round(1.0 / DT) :] for x in (*(levels[level] for levels in bars.values()), truth)]
        lines[f"bar, level {level}: the tip swings in the last second by"] = [np.ptp(heights) for heights in last]
    return lines


def film_of_bars(bars: Mapping[str, Sequence[np.ndarray]], truth: np.ndarray) -> Iterator[Image.Image]:
    """Frames with a picture a kind: level 0 filled, the finest level as a line, the truth as a black line."""
    meshes = [grid((1.0, 0.2), cuts) for cuts in BAR_CUTS]
    rims = [boundary_facets(mesh.cells)[0] for mesh in meshes]
    figure, (panes,) = panels((12.0, 3.6), 1, len(bars))
    everything = np.concatenate([truth.reshape(-1, 2), *(x.reshape(-1, 2) for each in bars.values() for x in each)])
    low, high = everything.min(axis=0) - 0.03, everything.max(axis=0) + 0.03
    coarse, fine = BAR_SHOWN
    for step in film_steps(0, len(truth) - 1, DT, FRAMES_PER_SECOND):
        for axes, (kind, levels) in zip(panes, bars.items(), strict=True):
            axes.clear()
            corners = levels[coarse][step][meshes[coarse].cells]
            axes.add_collection(PolyCollection(corners, facecolor=PALETTE[0], edgecolor="white", linewidth=0.6))
            lines = ((levels[fine], rims[fine], PALETTE[1], 2.0), (truth, rims[-1], TRUTH_INK, 1.6))
            for x, edges, colour, width in lines:
                axes.add_collection(LineCollection(x[step][edges], colors=colour, linewidths=width))
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
            axes.set_title(kind, fontsize=12, color=INK)
            axes.set_axis_off()
        shown = ("filled", coarse), ("blue line", fine)
        words = [f"{step * DT:.2f} s", *(f"{how}: level {level}" for how, level in shown), "black line: the truth"]
        figure.suptitle("     ".join(words), fontsize=12, color=INK)
        figure.canvas.draw()
        yield Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3].copy())


# ---- the ape


def ape_lines(heights: Mapping[str, Mapping[int, np.ndarray]], truth: np.ndarray) -> dict[str, list[float]]:
    """Lines of the table [m]: how high the centre comes, and how far its height is from the truth's."""
    lines: dict[str, list[float]] = {}
    for level in APE_SHOWN:
        highest = [each[level].max() for each in heights.values()]
        lines[f"ape, level {level}: the centre rises by"] = [*highest, truth.max()]
    for level in APE_SHOWN:
        apart = [np.sqrt(((each[level] - truth) ** 2).mean()) for each in heights.values()]
        lines[f"ape, level {level}: its height from the truth's, root mean square"] = [*apart, 0.0]
    return lines


def film_of_apes(apes: Mapping[str, Run], true: Run) -> Iterator[Image.Image]:
    """Frames with a column a kind, a row a level, and the truth in the last column."""
    every = round(DT / TRUE_DT)
    # The truth comes highest: all fits into its picture.
    highest = [step * every for step in range(STEPS + 1)]
    (camera, *_) = cameras_of_run(true, [true.levels[-1]], highest, aspect=CELL[0] / CELL[1])
    kinds = [*apes.items(), ("truth", true)]
    panes = [ape_pane(kind, run, index, run is true) for index in APE_SHOWN for kind, run in kinds]
    moments = [[(step * (every if pane.run is true else 1), None) for pane in panes] for step in range(STEPS + 1)]
    return frames(renderer_by(camera, CELL), Grid(len(panes), len(kinds), CELL, above=HEADER), panes, moments)


def ape_pane(kind: str, run: Run, index: int, true: bool) -> Pane:
    """A place of the film: a level of a kind, or the finest one of the truth."""
    level = run.levels[-1 if true else index]

    def words(pen: Pen, step: int) -> None:
        pen.text(10, 14 - HEADER, kind, 15)
        note = f"{step * run.dt:.2f} s" if true else f"level {index}, {len(level.rest):,} vertices"
        pen.text(10, 31 - HEADER, note, 13, FAINT_INK)

    return Pane(run, level, words)


# ---- both


def curves(out: Path, label: str, found: Mapping[str, Mapping[int, np.ndarray]], truth: np.ndarray) -> None:
    """A panel a kind: a line a level, and the truth."""
    figure, (axes,) = panels((12.0, 3.3), 1, len(found), sharey=True)
    times = DT * np.arange(len(truth))
    for one, (kind, levels) in zip(axes, found.items(), strict=True):
        for level, values in levels.items():
            one.plot(times, values, color=PALETTE[level], label=f"level {level}", linewidth=1.5)
        one.plot(times, truth, color=TRUTH_INK, linestyle="--", label="truth", linewidth=1.5)
        over_time(one, kind, y=label if one is axes[0] else "")
    figure.savefig(out, dpi=110)
    fit_picture(out)
