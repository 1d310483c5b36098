"""Plots: curves of a run's metrics over time, one colour per level, on logarithmic axes (as the paper's figures), and
parameters of variations against their scores.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from pdvol.errors import InputError
from pdvol.studio.draw.layout import BACKGROUND, FAINT_INK, INK, write_png
from pdvol.studio.shown import PALETTE

PANELS = {
    "continuity": "continuity n",
    "continuity_error": "continuity error e [kg m²]",
    "consistency": "consistency d, to the level below [kg m²]",
    "distance": "distance from the prolonged level below [m]",
    "centre_drift": "drift of a body's centre from the level below, the largest [m]",
    "angle_drift": "turn of a body against the level below, the largest [degrees]",
    "centre_drift_from_0": "drift of a body's centre from level 0, the largest [m]",
    "jitter": "jitter [J]",
}

STEP_MEASURES = ("continuity", "continuity_error", "jitter")  # begin at step 1; the others, of states, at step 0
# Decades drawn below a measure's largest value: what is smaller is round-off. Continuity, a quotient of residuals, has
# no such floor.
DECADES = 9
PLOT_INCHES = 2.4  # side of one small plot of a scatter
DPI = 130  # pixels per inch


def plot_metrics(path: Path, runs: Sequence[dict]) -> Path:
    """Draw the metrics of one run, or of two for comparison (the second one dashed), into a .png.

    Parameters
    ----------
    runs : what `pdvol.runs.run_metrics.measure_run` returns
    """
    present = [key for key in PANELS if any(_curve(level, key, run["dt"]) for run in runs for level in run["levels"])]
    last = max(level["steps"] for run in runs for level in run["levels"]) * runs[0]["dt"] or 1.0
    figure = Figure(figsize=(7.0, 2.3 * max(len(present), 1)), facecolor=BACKGROUND, layout="constrained")
    for row, key in enumerate(present):
        axes = figure.add_subplot(len(present), 1, row + 1, facecolor=BACKGROUND)
        for run, style in zip(runs, ("-", "--"), strict=False):
            for level in run["levels"]:
                curve = _curve(level, key, run["dt"])
                if curve:
                    label = f"level {level['level']}" + (f", {Path(run['run']).name}" if len(runs) > 1 else "")
                    axes.plot(*curve, style, color=PALETTE[level["level"] % len(PALETTE)], label=label, linewidth=1.3)
        axes.set_yscale("log")
        axes.set_title(PANELS[key], fontsize=9, loc="left")
        axes.tick_params(labelsize=8, which="both")
        if key != "continuity":
            axes.set_ylim(bottom=max(axes.get_ylim()[0], axes.dataLim.y1 * 10.0**-DECADES))
        axes.set_xlim(0.0, last)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(fontsize=7, frameon=False, ncols=2, loc="center left", bbox_to_anchor=(1.0, 0.5))
        if row == len(present) - 1:
            axes.set_xlabel("time [s]", fontsize=8)
    return _written(figure, path)


def _curve(level: dict, key: str, dt: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Times and values that a logarithmic axis can show, the positive ones; None without any."""
    values = np.array(level.get(key) or [], dtype=float)
    shown = values > 0
    return ((np.flatnonzero(shown) + (key in STEP_MEASURES)) * dt, values[shown]) if shown.any() else None


def scatter_image(
    values: Mapping[str, Sequence[object]],
    scores: Mapping[str, Sequence[float | None]],
    names: Sequence[str],
    out: str | Path,
) -> Path:
    """Draw each parameter against each score into a .png; the best variation of a score has its name beside it.

    Parameters
    ----------
    values : of each parameter, one value per variation; what is no number has its place on the axis and its text there
    scores : of each score, one per variation; None or NaN, which cannot be said, are crosses below all others
    names : of the variations
    out : the file

    Raises
    ------
    InputError
        There is nothing to draw, or the numbers of values, scores and names differ.
    """
    out, count = Path(out), len(names)
    if not values or not scores or count == 0:
        raise InputError(f"{out}: a scatter needs a parameter, a score and a variation at least")
    for name, column in [*values.items(), *scores.items()]:
        if len(column) != count:
            raise InputError(f"{out}: {name} has {len(column)} values for {count} variations")
    rows, columns = len(scores), len(values)
    figure = Figure((0.6 + PLOT_INCHES * columns, 0.5 + PLOT_INCHES * rows), facecolor=BACKGROUND, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharey="row", sharex="col")
    for i, (score, heights) in enumerate(scores.items()):
        y = np.array([np.nan if h is None else h for h in heights], dtype=float)
        known = np.isfinite(y)
        low, high = (y[known].min(), y[known].max()) if known.any() else (0.0, 1.0)
        floor = low - 0.12 * ((high - low) or 1.0)
        for j, (parameter, column) in enumerate(values.items()):
            axes = grid[i, j]
            x, ticks = _places(column)
            axes.set_facecolor(BACKGROUND)
            axes.plot(x[known], y[known], "o", color=PALETTE[1], markersize=4, alpha=0.75, markeredgewidth=0)
            axes.plot(x[~known], np.full(np.sum(~known), floor), "x", color=FAINT_INK, markersize=4)
            if known.any():
                best = int(np.nanargmax(np.where(known, y, np.nan)))
                axes.plot(x[best], y[best], "o", color=PALETTE[0], markersize=7, markeredgewidth=0)
                side = "right" if x[best] > np.mean([x.min(), x.max()]) else "left"
                offset = (-6 if side == "right" else 6, -3)
                axes.annotate(
                    names[best], (x[best], y[best]), offset, textcoords="offset points", fontsize=8, color=INK, ha=side
                )
            if ticks:
                axes.set_xticks(range(len(ticks)), ticks)
            axes.spines[["top", "right"]].set_visible(False)
            axes.tick_params(labelsize=8, colors=INK)
            if i == rows - 1:
                axes.set_xlabel(parameter, fontsize=9, color=INK)
            if j == 0:
                axes.set_ylabel(score, fontsize=9, color=INK, wrap=True)
    return _written(figure, out)


def _places(column: Sequence[object]) -> tuple[np.ndarray, list[str]]:
    """Places on an axis, and the texts of its ticks: none for numbers."""
    if all(isinstance(v, int | float | np.number) and not isinstance(v, bool) for v in column):
        return np.array(column, dtype=float), []
    texts = list(dict.fromkeys(str(v) for v in column))
    return np.array([texts.index(str(v)) for v in column], dtype=float), texts


def _written(figure: Figure, path: Path) -> Path:
    """Write a figure as .png into a folder that is made where there is none."""
    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return write_png(path, Image.fromarray(np.asarray(canvas.buffer_rgba())))
