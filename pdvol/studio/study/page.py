"""The page of a study: the front, a plot per axis, the sentences and the table, in one file without a network."""

import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from pdvol.store.files import write_bytes
from pdvol.studio.draw.layout import BACKGROUND, FAINT_INK, INK
from pdvol.studio.shown import PALETTE
from pdvol.studio.study.conclusions import option_text
from pdvol.studio.study.labels import place_labels
from pdvol.studio.wedge.variation import length

LABELLED = 14  # points of the front that carry their settings: more find no free place


def write_page(path: Path, study: Mapping[str, Any]) -> Path:
    """Write the page of a study's results (`study.json`) as one HTML file."""
    environment = Environment(
        loader=PackageLoader("pdvol.studio.study", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    template = environment.get_template("study.html.jinja")
    points = sorted(study["points"], key=lambda point: point["cost"]["cpu"])
    text = template.render(
        study=study,
        points=points,
        front=Markup(_svg(front_figure(study))) if points else "",
        axes=[Markup(axis_picture(order)) for order in study.get("orders", []) if order["values"]],
        sentences=study.get("sentences", []),
        length=length,
        options=option_text,
        by_option=_by_option,
        percent=lambda fraction: f"{fraction:.2%}",
        failed=[run for run in study["runs"] if run.get("state") not in ("done", None)],
        colours={"background": BACKGROUND, "ink": INK, "faint": FAINT_INK},
    )
    write_bytes(path, text.encode())
    return path


def front_figure(study: Mapping[str, Any]) -> Figure:
    """Time against error at the end; one colour per level, open marks for other outcomes."""
    figure, axes = _figure(8.6, 5.4)
    points = [p for p in study["points"] if p["errors"]["end"] > 0.0]
    for level in sorted({p["level"] for p in points}):
        for alone in (False, True):
            name = f"level {level}{' alone' if alone else ''}"
            for same in (True, False):
                mine = [
                    p
                    for p in points
                    if (p["level"], p["method"] == "direct", p["errors"]["outcome"]) == (level, alone, same)
                ]
                colour = PALETTE[level % len(PALETTE)]
                axes.plot(
                    [p["cost"]["cpu"] for p in mine],
                    [p["errors"]["end"] for p in mine],
                    "s" if alone else "o",
                    color=colour,
                    markerfacecolor=colour if same else "none",
                    markersize=6,
                    label=name if mine and name not in axes.get_legend_handles_labels()[1] else None,
                )
    front = sorted((p["cost"]["cpu"], p["errors"]["end"], p) for p in points if p["front"])
    axes.step([c for c, _, _ in front], [e for _, e, _ in front], where="post", color=FAINT_INK, linewidth=1.0)
    shown = front if len(front) <= LABELLED else [front[i] for i in _spread(len(front), LABELLED)]
    default, lines = study.get("default"), []
    if default:
        axes.plot(
            default["cost"]["cpu"],
            default["errors"]["end"],
            "*",
            color=INK,
            markersize=13,
            label="the scene's settings",
        )
    for value, text in (
        (study["reference"]["error"], "the reference's own error"),
        ((study["spread"] or {}).get("end") if (study["spread"] or {}).get("chaotic") else None, "the scene's spread"),
    ):
        if value:
            axes.axhline(value, color=FAINT_INK, linestyle=":", linewidth=1.0)
            lines.append((text, value))
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("CPU time of the steps [s]")
    axes.set_ylabel("error at the end, root mean square [m]")
    axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    marks = [(p["cost"]["cpu"], p["errors"]["end"]) for p in [*points, *([default] if default else [])]]
    right = axes.get_xlim()[1]
    texts = [(text, right, value) for text, value in lines]
    texts += [(point["label"].partition(", ")[2] or "as the scene has it", cost, error) for cost, error, point in shown]
    place_labels(figure, axes, texts, marks)
    return figure


def axis_picture(order: Mapping[str, Any]) -> str:
    """Differences to the finest value of one axis, and the fit, as SVG."""
    figure, axes = _figure(4.2, 3.2)
    values, differences = (np.array(column) for column in zip(*order["values"], strict=True))
    axes.plot(values, differences, "o", color=PALETTE[1])
    title = f"{order['axis']}: no order is seen"
    if order["order"] is not None:
        p, finest = order["order"], order["finest"]
        fitted = order["fitted"]
        model = abs(values[fitted] ** p - finest**p)
        constant = float(np.exp(np.mean(np.log(differences[fitted] / model))))
        h = np.geomspace(values.min(), values.max(), 60)
        axes.plot(h, constant * abs(h**p - finest**p), color=FAINT_INK, linewidth=1.0)
        title = f"{order['axis']}: order {p:.2f}"
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_title(title, fontsize=9, loc="left")
    axes.set_xlabel(order["axis"], fontsize=8)
    axes.set_ylabel(f"apart from {order['finest']:.3g} [m]", fontsize=8)
    return _svg(figure)


def _figure(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height), facecolor=BACKGROUND, layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.add_subplot(facecolor=BACKGROUND)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8, which="both")
    return figure, axes


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _by_option(words: str) -> Markup:
    """Options of a command line as HTML: lines break between them only."""
    options = re.split(r" (?=--)", words)
    return Markup(" ").join(Markup('<span class="option">{}</span>').format(option) for option in options)


def _spread(count: int, wanted: int) -> Sequence[int]:
    """Indices spread evenly over `count`, ends included."""
    return np.unique(np.linspace(0, count - 1, wanted).round().astype(int)).tolist()
