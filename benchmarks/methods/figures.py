"""The figures of benchmarks.methods: finest levels side by side at the same moments, and consistency over time."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.methods.studies import Study
from pdvol import open_run
from pdvol.studio.draw.camera import camera_of_run
from pdvol.studio.draw.layout import BACKGROUND
from pdvol.studio.draw.renderer import Renderer
from pdvol.studio.shown import PALETTE

WIDTH = 420  # pixels of one picture
FLOOR = 1e-7  # of the largest value: what is drawn of consistency


def draw(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """The study's figure."""
    shapes(path, study, records, runs)
    if study.figure == "curves":
        curves(path.with_name(f"{path.stem}_curves.png"), records)


def _shots(study: Study, runs: Sequence[Path]) -> list[list[np.ndarray]]:
    """Rows of pictures by one camera: level 0 of the first run, then the finest level of every run; columns are the
    study's moments.
    """
    stored = [open_run(path) for path in runs]
    last = min(level.steps for run in stored for level in run.levels) - 1
    steps = sorted({min(step, last) for step in study.moments})
    camera = camera_of_run(
        stored[0], [level for run in stored for level in (run.levels[0], run.levels[-1])], steps, stored[0].obstacles
    )
    rows = []
    for run, level in [(stored[0], stored[0].levels[0]), *((run, run.levels[-1]) for run in stored)]:
        with Renderer(run, camera, WIDTH, run.obstacles) as renderer:
            rows.append([np.asarray(renderer.picture(level, step)) for step in steps])
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


def curves(path: Path, records: Sequence[dict]) -> None:
    """Draws consistency over time: of the finest level for every weight, of each level for the second smallest one."""
    figure = Figure(figsize=(11.0, 3.6), facecolor=BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    for k, record in enumerate(records):
        _curve(
            left,
            record["levels"][-1],
            record["dt"],
            PALETTE[k % len(PALETTE)],
            f"w = {record['settings']['consistency']:g}",
        )
    left.set_title(f"finest level ({len(records[0]['levels']) - 1})", fontsize=9, loc="left")
    held = next(r for r in records if r["settings"]["consistency"] == 0.025)
    for level in held["levels"][1:]:
        _curve(right, level, held["dt"], PALETTE[level["level"] % len(PALETTE)], f"level {level['level']}")
    right.set_title("each level, w = 0.025", fontsize=9, loc="left")
    for one in (left, right):
        one.set_yscale("log")
        one.set_xlabel("time [s]", fontsize=8)
        one.set_ylabel("consistency d, to the level below [kg m²]", fontsize=8)
        one.set_facecolor(BACKGROUND)
        one.spines[["top", "right"]].set_visible(False)
        one.set_ylim(bottom=max(one.get_ylim()[0], one.dataLim.y1 * FLOOR))
        one.legend(fontsize=7, frameon=False, ncols=2)
    figure.savefig(path, dpi=130)


def _curve(axes, level: dict, dt: float, colour: str, label: str) -> None:
    values = np.array(level["consistency"], dtype=float)
    shown = values > 0
    axes.plot(np.flatnonzero(shown) * dt, values[shown], color=colour, label=label, linewidth=1.3)
