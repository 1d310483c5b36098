"""Parameters of variations against what they are worth: a row for each score, a column for each parameter."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pdvol.draw.layout import BACKGROUND, PALETTE
from pdvol.store.files import write_bytes

MOST_LABELS = 40  # variations that have their numbers beside their points: more would cover each other


def scatter(
    path: Path,
    across: Mapping[str, Sequence[float | None]],
    up: Mapping[str, Sequence[float | None]],
    groups: Sequence[int],
    numbers: Sequence[int],
) -> Path:
    """Draw a .png of points, one for each variation, in the colour of its group; None is not drawn.

    Parameters
    ----------
    across, up : values of the n variations, by name
    groups : (n,) a colour for each number from 0 on; grey below 0
    numbers : (n,) written beside the points
    """
    figure = Figure(figsize=(1.0 + 3.6 * len(across), 0.6 + 2.8 * len(up)), facecolor=BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
    plots = figure.subplots(len(up), len(across), squeeze=False, sharex="col", sharey="row")
    for row, (score, values) in zip(plots, up.items(), strict=True):
        row[0].set_ylabel(score, fontsize=8)
        for axes, (name, its) in zip(row, across.items(), strict=True):
            for x, y, group, number in zip(its, values, groups, numbers, strict=True):
                if x is None or y is None:
                    continue
                axes.plot(x, y, "o", markersize=4, color=PALETTE[group % len(PALETTE)] if group >= 0 else "0.5")
                if len(numbers) <= MOST_LABELS:
                    axes.annotate(str(number), (x, y), (3, 2), textcoords="offset points", fontsize=6)
            axes.set_facecolor(BACKGROUND)
            axes.tick_params(labelsize=7)
            axes.spines[["top", "right"]].set_visible(False)
            if row is plots[-1]:
                axes.set_xlabel(name, fontsize=8)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130)
    write_bytes(path, buffer.getvalue())
    return path
