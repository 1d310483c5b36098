"""Labels beside the points of a plot, where they cover neither each other nor points: the first free place of each,
from near to far.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pdvol.studio.draw.layout import FAINT_INK, INK

DISTANCES = (6.0, 14.0, 24.0, 36.0, 50.0, 66.0, 84.0)  # points, of a label from what it names
LED_FROM = 20.0  # points: a label so far away has a line to its point
MARKER = 5.0  # points: half the side of the square that a marker takes
CLEARANCE = 1.0  # points between labels
# Of a label from its point, in halves of its size: above or below a horizontal line through the point.
SIDES = ((1, 0.8), (-1, -0.8), (1, -0.8), (-1, 0.8), (0, 1), (0, -1))


def place_labels(
    figure: Figure,
    axes: Axes,
    labels: Sequence[tuple[str, float, float]],
    points: Sequence[tuple[float, float]],
    size: float = 7.0,
) -> None:
    """Write labels (text, x, y) beside their places, clear of points (x, y) and of the texts that the axes have.

    Where nothing is free a label takes the place where it covers least. Scales must be final; the axes' limits and
    place in the figure are held from here on.
    """
    figure.draw_without_rendering()  # puts the axes where the layout has them
    figure.set_layout_engine("none")
    axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim())
    renderer, unit = FigureCanvasAgg(figure).get_renderer(), figure.dpi / 72.0  # pixels of a point
    frame = np.array(axes.get_window_extent(renderer).extents)
    markers = axes.transData.transform(np.array(points, dtype=float).reshape(-1, 2))
    taken = [np.array(text.get_window_extent(renderer).extents) for text in axes.texts]
    taken += [np.r_[at - MARKER * unit, at + MARKER * unit] for at in markers]
    for text, x, y in labels:
        at = axes.transData.transform((x, y))
        note = axes.annotate(text, (x, y), xytext=(0, 0), textcoords="offset points", fontsize=size, color=INK)
        extent = np.array(note.get_window_extent(renderer).extents)
        box, away = _place(at, extent[2:] - extent[:2], unit, frame, np.array(taken).reshape(-1, 4))
        note.set_position(tuple((box[:2] - extent[:2]) / unit))
        taken.append(box)
        if away > LED_FROM:
            end = np.clip(at, box[:2], box[2:])
            line = {"arrowstyle": "-", "color": FAINT_INK, "linewidth": 0.5, "shrinkA": 0.0, "shrinkB": 2.0}
            axes.annotate("", (x, y), xytext=tuple((end - at) / unit), textcoords="offset points", arrowprops=line)


def _place(
    at: np.ndarray, wide: np.ndarray, unit: float, frame: np.ndarray, taken: np.ndarray
) -> tuple[np.ndarray, float]:
    """The box (4,) [pixels] of a label of this size beside a point, and how far away it is [points]: the first that
    covers nothing, else the one that covers least.
    """
    sides = np.array(SIDES, dtype=float)
    lows = np.concatenate([at + sides * (away * unit + 0.5 * wide) - 0.5 * wide for away in DISTANCES])
    boxes = np.column_stack([lows, lows + wide])
    wider = boxes + CLEARANCE * unit * np.array([-1.0, -1.0, 1.0, 1.0])
    outside = np.prod(wide) - _overlaps(boxes, frame[None])[:, 0]
    covered = _overlaps(wider, taken).sum(axis=1) + np.maximum(outside, 0.0)
    free = covered < 1e-3  # square pixels
    best = int(np.argmax(free) if free.any() else np.argmin(covered))
    return boxes[best], DISTANCES[best // len(sides)]


def _overlaps(boxes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(k, m) areas in which boxes (k, 4) and others (m, 4) overlap."""
    one, other = boxes[:, None], others[None]
    sizes = np.minimum(one[..., 2:], other[..., 2:]) - np.maximum(one[..., :2], other[..., :2])
    return np.prod(np.maximum(sizes, 0.0), axis=2)
