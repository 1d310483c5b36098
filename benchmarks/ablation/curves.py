"""Newton iterations, linear solves and CPU time of each step, with all rules and without one: the picture of
benchmarks.ablation.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.common.tables import number
from pdvol.studio.draw.layout import BACKGROUND
from pdvol.studio.shown import PALETTE

PANELS = {
    "Newton iterations": lambda row: row["newton_iterations"],
    "iterations of conjugate gradients": lambda row: row["linear_iterations"],
    "processor time [s]": lambda row: row["seconds"]["cpu"],
}
"""Titles, and what is drawn of a step's row of the log."""


def draw_curves(out: Path, logs: Mapping[str, Sequence[dict]], dt: float) -> Path:
    """Draws one curve for each of the logs, by their names, into a .png; means are in the legend."""
    figure = Figure(figsize=(7.0, 6.0), facecolor=BACKGROUND, layout="constrained")
    for place, (title, value) in enumerate(PANELS.items()):
        axes = figure.add_subplot(len(PANELS), 1, place + 1, facecolor=BACKGROUND)
        for (name, log), colour in zip(logs.items(), PALETTE, strict=False):
            values = np.array([value(row) for row in log], dtype=float)[1:]  # the first step has the set-up
            label = f"{name}: {number(values.mean())} a step, {number(values.max())} at most"
            axes.plot(dt * np.arange(2, len(log) + 1), values, color=colour, linewidth=1.3, label=label)
        axes.set_title(title, fontsize=9, loc="left")
        axes.tick_params(labelsize=8)
        axes.set_ylim(bottom=0.0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(fontsize=8, frameon=False)
    axes.set_xlabel("time [s]", fontsize=8)
    FigureCanvasAgg(figure).print_png(str(out))
    return out
