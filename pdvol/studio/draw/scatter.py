"""Parameters against scores: small plots, a column a parameter, a row a score."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pdvol.errors import InputError
from pdvol.store.files import write_bytes
from pdvol.studio.colours import PALETTE
from pdvol.studio.draw.layout import BACKGROUND, FAINT_INK, INK

PLOT_INCHES = 2.4  # side of one small plot
SCATTER_DPI = 130  # pixels per inch


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
    FigureCanvasAgg(figure)
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
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=SCATTER_DPI)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(out, buffer.getvalue())
    return out


def _places(column: Sequence[object]) -> tuple[np.ndarray, list[str]]:
    """Places on an axis, and the texts of its ticks: none for numbers."""
    if all(isinstance(v, int | float | np.number) and not isinstance(v, bool) for v in column):
        return np.array(column, dtype=float), []
    texts = list(dict.fromkeys(str(v) for v in column))
    return np.array([texts.index(str(v)) for v in column], dtype=float), texts
