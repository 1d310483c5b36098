"""Figures of studies: pictures and curves on pdvol's own background."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pdvol.studio.draw.layout import BACKGROUND


def panels(size: tuple[float, float], rows: int = 1, columns: int = 1, **more) -> tuple[Figure, np.ndarray]:
    """A figure of so many inches, and its axes (rows, columns); `more` goes to `subplots`."""
    figure = Figure(figsize=size, facecolor=BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **more)


def over_time(axes: Axes, title: str = "", x: str = "time [s]", y: str = "", legend: bool = True) -> None:
    """Axes for curves, with labels, a title on the left and a legend; call it when they are drawn."""
    axes.set_facecolor(BACKGROUND)
    axes.set_title(title, fontsize=9, loc="left")
    axes.set_xlabel(x, fontsize=8)
    axes.set_ylabel(y, fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    if legend:
        axes.legend(fontsize=8, frameon=False)
