"""The figures of benchmarks.methods: levels side by side at the same moments, and continuity and consistency over
time.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.common.figures import over_time, panels
from benchmarks.divergence.__main__ import distances
from benchmarks.methods.studies import LITERAL, Study
from demos.gallery.film import COLOURS, fit_picture
from pdvol import open_run
from pdvol.measure import verify
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.draw.compose import Grid, Pane, Pen, composed
from pdvol.studio.draw.layout import rgb, write_png
from pdvol.studio.draw.views import STANDARD_SHOT, Shot
from pdvol.studio.shown import PALETTE
from pdvol.studio.wedge.variation import length

WIDTH, GAP, ABOVE = 880, 4, 34
"""Pixels of a figure, between its pictures, and of the words above each."""
FLOOR = 1e-7
"""Share of the largest value below which nothing is drawn over time: rounding, before anything touches."""
METRICS = {
    "continuity": "continuity n",
    "continuity_error": "continuity error e [kg m²]",
    "consistency": "consistency d, to the level below [kg m²]",
}
"""What is drawn over time, by its name in `pdvol.runs.run_metrics`."""
CROSSING = (0.85, 0.0, 0.05)
"""Red, green and blue from 0 to 1, of cells that cross."""


def draw(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """The study's figures, made small: NAME.png of its shapes or crossings, and NAME_FIGURE.png of each other one."""
    for name in study.figures:
        out = path if name in ("shapes", "crossings") else path.with_stem(f"{path.stem}_{name}")
        FIGURES[name](out, study, records, runs)
        fit_picture(out, colours=256 if name == "crossings" else COLOURS)  # of 64, red is none


def moments(study: Study, stored: Sequence[Run]) -> list[int]:
    """The study's moments, as far as all levels have them."""
    last = min(level.steps for run in stored for level in run.levels) - 1
    return sorted({min(step, last) for step in study.moments})


def pictures(path: Path, shown: Sequence[tuple[Pane, int]], columns: int, shot: Shot = STANDARD_SHOT) -> None:
    """Draws panes, each at its step, by one camera."""
    panes, steps = zip(*shown, strict=True)
    moments = sorted(set(steps))
    grid, shot = Grid(len(panes), columns, above=ABOVE, gap=GAP), replace(shot, width=(WIDTH + GAP) // columns - GAP)
    write_png(path, next(composed(panes, moments, shot, grid, [[moments.index(step) for step in steps]])))


def pane(run: Run, level: RunLevel, *lines: str, colours: np.ndarray | None = None) -> Pane:
    """A level below so many lines of words."""

    def words(pen: Pen, step: int) -> None:
        for k, line in enumerate(lines):
            pen.text(4, 15 * k + 9 - ABOVE, line, 11)

    return Pane(run, level, words, colours)


def shapes(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """Rows of moments: level 0 of the first case, then the finest level of each; as many cases as there is room for,
    and the others below.
    """
    stored = [open_run(run) for run in runs]
    names = [record["name"].split(" ", 1) for record in records]
    cases = [pane(run, run.levels[-1], *name) for run, name in zip(stored, names, strict=True)]
    first, shown = pane(stored[0], stored[0].levels[0], "level 0"), []
    beside = min(study.across, len(cases) + 1) - 1
    cases += [Pane(None, None)] * (-len(cases) % beside)
    for k in range(0, len(cases), beside):
        shown += [(one, step) for step in moments(study, stored) for one in (first, *cases[k : k + beside])]
    pictures(path, shown, beside + 1)


def crossings(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """The finest level of each case at the study's moment, cut open; before embedded ones their level 0. Cells are red
    whose boundary triangles an edge of the boundary goes through; the triangles are counted.
    """
    stored, shown = [open_run(run) for run in runs], []
    (step,) = moments(study, stored)
    for record, run in zip(records, stored, strict=True):
        for level in (run.levels[:1] if record["method"] == "embedded" else ()) + run.levels[-1:]:
            through = verify.crossings(level.positions(step), level.surface)
            triangles = {tuple(sorted(vertex for _, vertex in one[2:])) for one in through}
            colours = np.array([rgb(PALETTE[body % len(PALETTE)]) for body in level.bodies]) / 255.0
            for triangle in triangles:
                colours[np.isin(level.cells, triangle).sum(axis=1) == 3] = CROSSING
            words = record["name"] if level.index else f"level 0, {' '.join(record['name'].split()[2:])}"
            said = f"{len(triangles):,} of {len(level.surface):,} triangles are crossed"
            shown.append((pane(run, level, words, said, colours=colours), step))
    pictures(path, shown, study.across, study.shot)


def sweep(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """All levels of the paper's cases at the study's moments, a row each, with their distance from level 0."""
    weights = [record["settings"]["consistency"] for record in records]
    left_out = LITERAL if len(runs) > 1 else None
    stored = {weight: open_run(run) for weight, run in zip(weights, runs, strict=True) if weight != left_out}
    apart, shown = {weight: distances(run) for weight, run in stored.items()}, []
    for step in moments(study, list(stored.values())):
        for weight, run in stored.items():
            far = [f"frame {step}", *(length(float(apart[weight][fine.index, 0][step])) for fine in run.levels[1:])]
            words = [f"w = {weight:g}", *(f"level {level.index}" for level in run.levels[1:])]
            shown += [(pane(run, level, words[k], far[k]), step) for k, level in enumerate(run.levels)]
    pictures(path, shown, len(run.levels))


def metrics(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """What `METRICS` names at each step of the finest level, a curve for each interpolant of a progressive run."""
    figure, (axes,) = panels((11.0, 3.6), 1, len(METRICS))
    shown = [r for r in records if r["method"] == "progressive" and r["prolongation"] != "phong"]  # as the paper
    for one, (key, label) in zip(axes, METRICS.items(), strict=True):
        for k, record in enumerate(shown):
            first = 0 if key == "consistency" else 1
            _curve(one, record["levels"][-1][key], record["dt"], PALETTE[k], record["prolongation"], first, "-:"[k])
        _logarithmic(one, label, floor=key != "continuity")  # a ratio has no floor
    figure.savefig(path, dpi=130)


def curves(path: Path, study: Study, records: Sequence[dict], runs: Sequence[Path]) -> None:
    """Draws consistency over time: of the finest level for every weight, of each level for the weight nearest 0.025."""
    figure, ((left, right),) = panels((11.0, 3.6), 1, 2)
    for k, record in enumerate(records):
        finest, name = record["levels"][-1], f"w = {record['settings']['consistency']:g}"
        _curve(left, finest["consistency"], record["dt"], PALETTE[k % len(PALETTE)], name)
    held = min(records, key=lambda r: abs(r["settings"]["consistency"] - 0.025))
    for level in held["levels"][1:]:
        colour = PALETTE[level["level"] % len(PALETTE)]
        _curve(right, level["consistency"], held["dt"], colour, f"level {level['level']}")
    _logarithmic(left, METRICS["consistency"], f"finest level ({len(held['levels']) - 1})")
    _logarithmic(right, METRICS["consistency"], f"each level, w = {held['settings']['consistency']:g}")
    figure.savefig(path, dpi=80)


FIGURES = {"shapes": shapes, "crossings": crossings, "sweep": sweep, "metrics": metrics, "curves": curves}
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
