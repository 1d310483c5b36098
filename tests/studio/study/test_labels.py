"""Labels of a plot cover neither each other nor points, and stay in the axes."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pdvol.studio.study.labels import LED_FROM, place_labels


def plotted(points, texts, note=""):
    figure = Figure(figsize=(8.6, 5.4), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log")
    axes.plot(*np.array(points).T, "o", markersize=6)
    if note:
        axes.annotate(note, (1.0, points[0][1]), xycoords=("axes fraction", "data"), ha="right", va="bottom")
    place_labels(figure, axes, [(text, *point) for text, point in zip(texts, points, strict=False)], points)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return axes, canvas.get_renderer()


def boxes(axes, renderer):
    return np.array([text.get_window_extent(renderer).extents for text in axes.texts if text.get_text()])


def overlap(one, other):
    return np.prod(np.maximum(np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2]), 0.0))


@pytest.mark.parametrize("seed", range(2))
def test_they_cover_nothing(seed):
    """The points of a front come in close pairs, as settings of one level do."""
    cost = np.geomspace(1.0, 300.0, 14) * np.random.default_rng(seed).uniform(0.9, 1.1, 14)
    cost[1::2] = 1.02 * cost[::2]
    points = np.column_stack([np.sort(cost), 0.1 / np.sort(cost) ** 0.6 * (1.0 - 0.01 * np.arange(14))])
    texts = [f"dt=0.00{k}, tolerance=1e-{k}, dhat=0.01" for k in range(14)]
    axes, renderer = plotted(points, texts, "the reference's own error")
    found, frame = boxes(axes, renderer), axes.get_window_extent(renderer).extents
    assert len(found) == 15
    for i, one in enumerate(found):
        assert all(overlap(one, other) == 0.0 for other in found[:i])
        assert i == 0 or overlap(one, frame) == pytest.approx(np.prod(one[2:] - one[:2]))
    for x, y in axes.transData.transform(points):
        assert all(overlap(one, np.array([x - 3, y - 3, x + 3, y + 3])) == 0.0 for one in found)


def test_a_free_label_is_beside_its_point_and_a_far_one_has_a_line():
    points = np.array([[1.0, 1.0], [10.0, 0.1], [100.0, 0.01]])
    axes, renderer = plotted(points, ["one", "two", "three"])
    for at, box in zip(axes.transData.transform(points), boxes(axes, renderer), strict=True):
        assert np.linalg.norm(at - np.clip(at, box[:2], box[2:])) < 14.0
    assert all(text.arrow_patch is None for text in axes.texts)
    axes, _ = plotted(np.repeat(points, [1, 30, 1], axis=0) * np.linspace(1.0, 1.05, 32)[:, None], ["long " * 5] * 32)
    led = [text for text in axes.texts if text.arrow_patch is not None]
    assert led and all(np.linalg.norm(text.xyann) > 0.5 * LED_FROM for text in led)
