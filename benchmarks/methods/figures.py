"""The figures of benchmarks.methods: levels side by side at the same moments, and continuity and consistency over
time.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.common.figures import over_time, panels
from benchmarks.divergence.__main__ import distances
from benchmarks.methods.studies import LITERAL, Study
from pdvol import open_run
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.draw.camera import cameras_of_run
from pdvol.studio.draw.compose import Grid, Pane, Pen, frames, renderer_by
from pdvol.studio.draw.layout import write_png
from pdvol.studio.shown import PALETTE
from pdvol.studio.wedge.variation import length

WIDTH, SMALL_WIDTH, ABOVE = 300, 170, 34
"""Pixels of one picture, of one of a sweep, and of the words above."""
ACROSS = 5
"""Pictures side by side at most, where each case has a column."""
FLOOR = 1e-7
"""Share of the largest value below which nothing is drawn over time: rounding, before anything touches."""
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


# ---- pictures


def moments(study: Study, stored: Sequence[Run]) -> list[int]:
    """The study's moments, as far as all levels have them."""
    last = min(level.steps for run in stored for level in run.levels) - 1
    return sorted({min(step, last) for step in study.moments})


def pictures(path: Path, shown: Sequence[tuple[Pane, int]], columns: int, width: int) -> None:
    """Draws panes, each at its step, by one camera."""
    panes, steps = zip(*shown, strict=True)
    levels = [pane.level for pane in panes if pane.level is not None]
    camera = cameras_of_run(panes[0].run, levels, sorted(set(steps)))[0]
    size = (width, round(width / camera.aspect))
    grid = Grid(len(panes), columns, size, above=ABOVE, gap=4)
    (page,) = frames(renderer_by(camera, size), grid, panes, [[(step, None) for step in steps]])
    write_png(path, page)


def pane(run: Run, level: RunLevel, *lines: str) -> Pane:
    """A level below so many lines of words."""

    def words(pen: Pen, step: int) -> None:
        for k, line in enumerate(lines):
            pen.text(4, 15 * k + 9 - ABOVE, line, 11)

    return Pane(run, level, words)


def shapes(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """Level 0 of the first case and the finest level of every one, a column each, a row a moment."""
    stored = [open_run(run) for run in runs]
    names = [record["name"].split(" ", 1) for record in records]
    columns = [pane(stored[0], stored[0].levels[0], "level 0")]
    columns += [pane(run, run.levels[-1], *name) for run, name in zip(stored, names, strict=True)]
    across, shown = min(len(columns), ACROSS), []
    columns += [Pane(None, None)] * (-len(columns) % across)
    for first in range(0, len(columns), across):
        shown += [(one, step) for step in moments(study, stored) for one in columns[first : first + across]]
    pictures(path, shown, across, WIDTH)


def sweep(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """All levels of the paper's cases at the study's moments, a row each, with their distance from level 0."""
    weights = [record["settings"]["consistency"] for record in records]
    stored = {weight: open_run(run) for weight, run in zip(weights, runs, strict=True) if weight != LITERAL}
    apart = {weight: distances(run) for weight, run in stored.items()}
    shown = []
    for step in moments(study, list(stored.values())):
        for weight, run in stored.items():
            far = ["", *(length(float(apart[weight][level.index, 0][step])) for level in run.levels[1:])]
            words = [f"w = {weight:g}, frame {step}", *(f"level {level.index}" for level in run.levels[1:])]
            shown += [(pane(run, level, words[k], far[k]), step) for k, level in enumerate(run.levels)]
    pictures(path, shown, len(next(iter(stored.values())).levels), SMALL_WIDTH)


# ---- curves


def metrics(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """What `METRICS` names at each step of the finest level, a curve for each interpolant of a progressive run."""
    figure, (axes,) = panels((11.0, 3.6), 1, len(METRICS))
    shown = [r for r in records if r["method"] == "progressive" and r["prolongation"] in COMPARED]
    for one, (key, label) in zip(axes, METRICS.items(), strict=True):
        for k, record in enumerate(shown):
            first = 0 if key == "consistency" else 1
            _curve(one, record["levels"][-1][key], record["dt"], PALETTE[k], record["prolongation"], first, "-:"[k])
        _logarithmic(one, label, floor=key != "continuity")  # a ratio has no floor
    figure.savefig(path, dpi=130)


def curves(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """Draws consistency over time: of the finest level for every weight, of each level for the second smallest one."""
    figure, ((left, right),) = panels((11.0, 3.6), 1, 2)
    for k, record in enumerate(records):
        finest, name = record["levels"][-1], f"w = {record['settings']['consistency']:g}"
        _curve(left, finest["consistency"], record["dt"], PALETTE[k % len(PALETTE)], name)
    held = next(r for r in records if r["settings"]["consistency"] == 0.025)
    for level in held["levels"][1:]:
        colour = PALETTE[level["level"] % len(PALETTE)]
        _curve(right, level["consistency"], held["dt"], colour, f"level {level['level']}")
    for one, title in ((left, f"finest level ({len(records[0]['levels']) - 1})"), (right, "each level, w = 0.025")):
        _logarithmic(one, METRICS["consistency"], title)
    figure.savefig(path, dpi=130)


FIGURES = {"shapes": shapes, "sweep": sweep, "metrics": metrics, "curves": curves}
"""How each is drawn: (path, study, records, runs)."""


def _logarithmic(axes, label: str, title: str = "", floor: bool = True) -> None:
    """What all curves have in common; `label` of the upright axis."""
    axes.set_yscale("log")
    over_time(axes, title, y=label)
    if floor:
        axes.set_ylim(bottom=max(axes.get_ylim()[0], axes.dataLim.y1 * FLOOR))


def _curve(axes, values: Sequence, dt: float, colour: str, label: str, first: int = 0, style: str = "-") -> None:
    """One curve; `first` is the step of the first value."""
    values = np.array(values, dtype=float)
    shown, width = values > 0, 1.3 if style == "-" else 2.0
    times = (np.flatnonzero(shown) + first) * dt
    axes.plot(times, values[shown], color=colour, label=label, linestyle=style, linewidth=width)
