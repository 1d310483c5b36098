"""Curves of a run's metrics over time, one colour per level, on logarithmic axes (as the paper's figures)."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pdvol.store.files import write_bytes
from pdvol.studio.colours import PALETTE
from pdvol.studio.draw.layout import BACKGROUND

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


def plot_metrics(path: Path, runs: Sequence[dict]) -> Path:
    """Draw the metrics of one run, or of two for comparison (the second one dashed), into a .png.

    Parameters
    ----------
    runs : what `pdvol.runs.run_metrics.measure_run` returns
    """
    present = [key for key in PANELS if any(_curve(level, key, run["dt"]) for run in runs for level in run["levels"])]
    last = max(level["steps"] for run in runs for level in run["levels"]) * runs[0]["dt"] or 1.0
    figure = Figure(figsize=(7.0, 2.3 * max(len(present), 1)), facecolor=BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
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
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130)
    write_bytes(path, buffer.getvalue())
    return path


def _curve(level: dict, key: str, dt: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Times and values that a logarithmic axis can show, the positive ones; None without any."""
    values = np.array(level.get(key) or [], dtype=float)
    shown = values > 0
    return ((np.flatnonzero(shown) + (key in STEP_MEASURES)) * dt, values[shown]) if shown.any() else None
