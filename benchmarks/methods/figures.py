"""The figures of benchmarks.methods: levels side by side at the same moments, and continuity and consistency over
time.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.divergence.__main__ import distances
from benchmarks.methods.studies import LITERAL, Study
from pdvol import open_run
from pdvol.studio.draw.camera import cameras_of_run
from pdvol.studio.draw.compose import renderer_by
from pdvol.studio.draw.layout import BACKGROUND
from pdvol.studio.shown import PALETTE
from pdvol.studio.wedge.variation import length

WIDTH = 420  # pixels of one picture
SMALL_WIDTH = 170  # pixels of one picture of a sweep
FLOOR = 1e-7  # of the largest value: what is drawn of it over time
METRICS = {
    "continuity": "continuity n",
    "continuity_error": "continuity error e [kg m²]",
    "consistency": "consistency d, to the level below [kg m²]",
}
"""What is drawn over time, by its name in `pdvol.runs.run_metrics`."""
COMPARED = ("barycentric", "biharmonic")
"""The paper's interpolants in its figure of metrics."""


def draw(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """The study's figures: NAME.png of its shapes, and NAME_FIGURE.png of each other one."""
    for name in study.figures:
        FIGURES[name](path if name == "shapes" else path.with_name(f"{path.stem}_{name}.png"), study, records, runs)


def _shots(study: Study, runs: Sequence[Path]) -> list[list[np.ndarray]]:
    """Rows of pictures by one camera: level 0 of the first run, then the finest level of every run; columns are the
    study's moments.
    """
    stored = [open_run(path) for path in runs]
    last = min(level.steps for run in stored for level in run.levels) - 1
    steps = sorted({min(step, last) for step in study.moments})
    levels = [level for run in stored for level in (run.levels[0], run.levels[-1])]
    camera = cameras_of_run(stored[0], levels, steps)[0]
    rows = []
    for run, level in [(stored[0], stored[0].levels[0]), *((run, run.levels[-1]) for run in stored)]:
        with renderer_by(camera, (WIDTH, round(WIDTH / camera.aspect))) as renderer:
            rows.append([np.asarray(renderer.picture(run, level, step)) for step in steps])
    return rows


def shapes(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """All cases at the study's moments, a column each."""
    rows = _shots(study, runs)
    names = ["level 0", *(record["name"].replace(" ", "\n") for record in records)]
    height, width = rows[0][0].shape[:2]
    count, moments = len(rows), len(rows[0])
    across = min(count, 5)
    bands = -(-count // across)
    size = (2.6 * across, (2.6 * height / width + 0.15) * moments * bands + 0.55 * bands)
    figure = Figure(figsize=size, facecolor=BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(moments * bands, across, squeeze=False)
    for one in axes.ravel():
        one.axis("off")
    for k, (name, row) in enumerate(zip(names, rows, strict=True)):
        for j, picture in enumerate(row):
            one = axes[(k // across) * moments + j, k % across]
            one.imshow(picture)
            if j == 0:
                one.set_title(name, fontsize=8)
    figure.savefig(path, dpi=130)


def sweep(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """All levels of the paper's cases at the study's moments, a row each, with their distance from level 0."""
    chosen = [k for k, record in enumerate(records) if record["settings"]["consistency"] != LITERAL]
    records, stored = [records[k] for k in chosen], [open_run(runs[k]) for k in chosen]
    steps = [min(step, min(level.steps for run in stored for level in run.levels) - 1) for step in study.moments]
    camera = cameras_of_run(stored[0], [level for run in stored for level in run.levels], sorted(set(steps)))[0]
    rows, levels = len(stored), len(stored[0].levels)
    figure = Figure(
        figsize=(1.5 * levels, (1.5 / camera.aspect + 0.16) * rows * len(steps) + 0.5), facecolor=BACKGROUND
    )
    FigureCanvasAgg(figure)
    figure.subplots_adjust(left=0.055, right=0.995, top=0.975, bottom=0.005, wspace=0.03, hspace=0.2)
    axes = figure.subplots(rows * len(steps), levels, squeeze=False)
    for row, (run, record) in enumerate(zip(stored, records, strict=True)):
        apart = distances(run)
        with renderer_by(camera, (SMALL_WIDTH, round(SMALL_WIDTH / camera.aspect))) as renderer:
            for level in run.levels:
                for moment, step in enumerate(steps):
                    one = axes[moment * rows + row, level.index]
                    one.imshow(np.asarray(renderer.picture(run, level, step)))
                    title = f"level {level.index}: " if row == 0 else ""
                    far = apart[level.index, 0][step] if level.index else None
                    one.set_title(f"{title}{'' if far is None else length(float(far))}".rstrip(": "), fontsize=8, pad=2)
        for moment, step in enumerate(steps):
            one = axes[moment * rows + row, 0]
            one.set_ylabel(f"w = {record['settings']['consistency']:g}\nframe {step}", fontsize=8)
    for one in axes.ravel():
        one.set_xticks([])
        one.set_yticks([])
        one.spines[:].set_visible(False)
    figure.savefig(path, dpi=110)


def metrics(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """What `METRICS` names at each step of the finest level, a curve for each interpolant of a progressive run."""
    figure = Figure(figsize=(11.0, 3.6), facecolor=BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
    shown = [r for r in records if r["method"] == "progressive" and r["prolongation"] in COMPARED]
    for axes, (key, label) in zip(figure.subplots(1, len(METRICS)), METRICS.items(), strict=True):
        for k, record in enumerate(shown):
            first = 0 if key == "consistency" else 1
            _curve(axes, record["levels"][-1][key], record["dt"], PALETTE[k], record["prolongation"], first, "-:"[k])
        _over_time(axes, label)
        if key != "continuity":  # a ratio, which has no floor
            _floor(axes)
    figure.savefig(path, dpi=130)


def curves(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """Draws consistency over time: of the finest level for every weight, of each level for the second smallest one."""
    figure = Figure(figsize=(11.0, 3.6), facecolor=BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    for k, record in enumerate(records):
        _curve(
            left,
            record["levels"][-1]["consistency"],
            record["dt"],
            PALETTE[k % len(PALETTE)],
            f"w = {record['settings']['consistency']:g}",
        )
    left.set_title(f"finest level ({len(records[0]['levels']) - 1})", fontsize=9, loc="left")
    held = next(r for r in records if r["settings"]["consistency"] == 0.025)
    for level in held["levels"][1:]:
        _curve(
            right, level["consistency"], held["dt"], PALETTE[level["level"] % len(PALETTE)], f"level {level['level']}"
        )
    right.set_title("each level, w = 0.025", fontsize=9, loc="left")
    for one in (left, right):
        _over_time(one, METRICS["consistency"])
        _floor(one)
    figure.savefig(path, dpi=130)


FIGURES = {"shapes": shapes, "sweep": sweep, "metrics": metrics, "curves": curves}
"""How each is drawn: (path, study, records, runs)."""


def _over_time(axes, label: str) -> None:
    """What all curves have in common; `label` of the upright axis."""
    axes.set_yscale("log")
    axes.set_xlabel("time [s]", fontsize=8)
    axes.set_ylabel(label, fontsize=8)
    axes.set_facecolor(BACKGROUND)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=7, frameon=False, ncols=2)


def _floor(axes) -> None:
    """Leave out what is below `FLOOR` of the largest value: rounding, before anything touches."""
    axes.set_ylim(bottom=max(axes.get_ylim()[0], axes.dataLim.y1 * FLOOR))


def _curve(
    axes, values: Sequence[float | None], dt: float, colour: str, label: str, first: int = 0, style: str = "-"
) -> None:
    """One curve; `first` is the step of the first value."""
    values = np.array(values, dtype=float)
    shown = values > 0
    axes.plot(
        (np.flatnonzero(shown) + first) * dt,
        values[shown],
        color=colour,
        label=label,
        linestyle=style,
        linewidth=1.3 if style == "-" else 2.0,
    )
