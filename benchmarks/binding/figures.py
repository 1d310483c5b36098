"""The pictures of benchmarks.binding: cells before and after snapping, and the weights of one coarse vertex."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap, SymLogNorm
from matplotlib.figure import Figure

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.meshing.tetrahedralise import mean_ratio
from pdvol.studio.draw.layout import BACKGROUND, INK
from pdvol.studio.shown import PALETTE

QUALITY = LinearSegmentedColormap.from_list("quality", ["#8c1537", "#e8603c", "#f6c667", "#dfe3e6", "#b9c4cf"])
"""From a flat cell to an equilateral one."""
WEIGHTS = LinearSegmentedColormap.from_list("weights", ["#123f7a", "#5f97cf", "#f1efea", "#f0a04b", "#9c2a12"])
"""From minus one over none to one."""
LEAST = 1e-5
"""Weight, without a unit, below which the colour is that of none."""
RING = 90.0
"""Area [points squared] of the ring around a flat or inverted cell: such a cell itself has nothing to see."""


def draw_snapping(path: Path, coarse: LevelMesh, fine: LevelMesh, places: Mapping[str, np.ndarray]) -> None:
    """A 2D coarse mesh as made, with its boundary snapped, and with all of its vertices snapped; rings are around cells
    that are flat or inverted.
    """
    figure = Figure(figsize=(11.0, 4.7), facecolor=BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 3)
    titles = ("coarse cells as made", "boundary snapped to the fine boundary", "all vertices snapped to fine ones")
    for axes, title, points in zip(panels, titles, (coarse.points, *places.values()), strict=True):
        quality = mean_ratio(points, coarse.cells)
        cells = PolyCollection(points[coarse.cells], array=quality, cmap=QUALITY, edgecolors=INK, linewidths=0.6)
        cells.set_clim(0.0, 1.0)
        axes.add_collection(cells)
        for part in fine.points[fine.boundary]:
            axes.plot(*part.T, color=PALETTE[0], linewidth=1.0, alpha=0.8, zorder=3)
        axes.plot(*fine.points.T, ".", color=PALETTE[0], markersize=3.0, zorder=4)
        flat = points[coarse.cells[quality == 0.0]].mean(axis=1)
        axes.scatter(*flat.T, RING, facecolors="none", edgecolors=QUALITY(0.0), linewidths=1.6, zorder=5)
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_title(f"{title}\nworst cell {quality.min():.2f}, {len(flat)} flat or inverted", fontsize=9, loc="left")
    bar = figure.colorbar(cells, ax=panels, shrink=0.8, pad=0.01)
    bar.set_label("mean ratio of a cell", fontsize=8)
    bar.ax.tick_params(labelsize=8)
    figure.savefig(path, dpi=110)


def draw_locality(
    path: Path,
    coarse: LevelMesh,
    fine: LevelMesh,
    barycentric: sp.csr_matrix,
    whole: np.ndarray,
    local: sp.csr_matrix,
) -> None:
    """The weights of one coarse vertex of a 2D pair: by name, as a map over the fine mesh, and over the distance."""
    chosen = int(np.argmin(np.linalg.norm(coarse.points - coarse.points.mean(axis=0), axis=1)))
    figure = Figure(figsize=(12.6, 4.6), facecolor=BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(1, 4, width_ratios=(1, 1, 1, 1.25))
    names = ("barycentric", "biharmonic, before", "biharmonic, after")
    norm = SymLogNorm(LEAST, vmin=-1.0, vmax=1.0)
    panels, columns = (
        [],
        [w[:, [chosen]].toarray()[:, 0] if sp.issparse(w) else w[:, chosen] for w in (barycentric, whole, local)],
    )
    numbers = [np.count_nonzero(w) if isinstance(w, np.ndarray) else w.nnz for w in (barycentric, whole, local)]
    for k, (name, column, count) in enumerate(zip(names, columns, numbers, strict=True)):
        axes = figure.add_subplot(grid[0, k])
        panels.append(axes)
        shown = axes.tripcolor(*fine.points.T, fine.cells, column, shading="gouraud", cmap=WEIGHTS, norm=norm)
        edges = np.unique(np.sort(coarse.cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
        axes.plot(
            *np.concatenate([coarse.points[edges], np.full((len(edges), 1, 2), np.nan)], axis=1).reshape(-1, 2).T,
            color=INK,
            linewidth=0.4,
            alpha=0.6,
        )
        axes.plot(*coarse.points[chosen], "o", markersize=5, markerfacecolor="none", color=INK)
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_title(
            f"{name}\n{count / len(fine.points):.0f} weights a vertex, {count:,} in all\nthese:"
            f" {np.count_nonzero(column):,} of {len(fine.points):,} vertices",
            fontsize=9,
            loc="left",
        )
    bar = figure.colorbar(shown, ax=panels, shrink=0.7, pad=0.01, location="bottom", aspect=50)
    bar.set_label("weight of the encircled coarse vertex", fontsize=8)
    bar.set_ticks([-1.0, -1e-2, -1e-4, 0.0, 1e-4, 1e-2, 1.0], labels=["-1", "-0.01", "-1e-4", "0", "1e-4", "0.01", "1"])
    bar.ax.tick_params(labelsize=8)
    axes = figure.add_subplot(grid[0, 3])
    distances = np.linalg.norm(fine.points - coarse.points[chosen], axis=1)
    for k, (name, column) in enumerate(zip(names[1:], columns[1:], strict=True)):
        there = column != 0.0
        axes.plot(distances[there], np.abs(column[there]), ".", color=PALETTE[k], markersize=4 - k, label=name)
    axes.set_yscale("log")
    axes.set_xlabel("distance from the coarse vertex [m]", fontsize=8)
    axes.set_ylabel("absolute weight", fontsize=8)
    axes.set_facecolor(BACKGROUND)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)
    axes.legend(fontsize=8, frameon=False)
    figure.savefig(path, dpi=110)
