"""The pictures of benchmarks.binding: cells before and after snapping, and the weights of one coarse vertex."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, SymLogNorm

from benchmarks.common.figures import over_time, panels
from demos.gallery.film import fit_picture
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.meshing.tetrahedralise import mean_ratio
from pdvol.studio.draw.layout import INK
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
    figure, (three,) = panels((11.0, 4.7), 1, 3)
    titles = ("coarse cells as made", "boundary snapped to the fine boundary", "all vertices snapped to fine ones")
    for axes, title, points in zip(three, titles, (coarse.points, *places.values()), strict=True):
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
    bar = figure.colorbar(cells, ax=three, shrink=0.8, pad=0.01)
    bar.set_label("mean ratio of a cell", fontsize=8)
    bar.ax.tick_params(labelsize=8)
    figure.savefig(path, dpi=110)
    fit_picture(path)


def draw_locality(
    path: Path, coarse: LevelMesh, fine: LevelMesh, barycentric: sp.csr_matrix, whole: np.ndarray, local: sp.csr_matrix
) -> None:
    """The weights of one coarse vertex of a 2D pair: by name, as a map over the fine mesh, and over the distance."""
    chosen = int(np.argmin(np.linalg.norm(coarse.points - coarse.points.mean(axis=0), axis=1)))
    figure, (axes,) = panels((12.6, 4.6), 1, 4, width_ratios=(1, 1, 1, 1.25))
    kinds = {"barycentric": barycentric.toarray(), "biharmonic, before": whole, "biharmonic, after": local.toarray()}
    columns = [weights[:, chosen] for weights in kinds.values()]
    edges = np.unique(np.sort(coarse.cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    for one, (name, weights), column in zip(axes, kinds.items(), columns, strict=False):
        norm = SymLogNorm(LEAST, vmin=-1.0, vmax=1.0)
        shown = one.tripcolor(*fine.points.T, fine.cells, column, shading="gouraud", cmap=WEIGHTS, norm=norm)
        one.add_collection(LineCollection(coarse.points[edges], colors=INK, linewidths=0.4, alpha=0.6))
        one.plot(*coarse.points[chosen], "o", markersize=5, markerfacecolor="none", color=INK)
        one.set_aspect("equal")
        one.set_axis_off()
        count, there, n = np.count_nonzero(weights), np.count_nonzero(column), len(fine.points)
        title = f"{name}\n{count / n:.0f} weights a vertex, {count:,} in all\nthese: {there:,} of {n:,} vertices"
        one.set_title(title, fontsize=9, loc="left")
    bar = figure.colorbar(shown, ax=axes[:3], shrink=0.7, pad=0.01, location="bottom", aspect=50)
    bar.set_label("weight of the encircled coarse vertex", fontsize=8)
    bar.set_ticks([-1.0, -1e-2, -1e-4, 0.0, 1e-4, 1e-2, 1.0], labels=["-1", "-0.01", "-1e-4", "0", "1e-4", "0.01", "1"])
    bar.ax.tick_params(labelsize=8)
    distances = np.linalg.norm(fine.points - coarse.points[chosen], axis=1)
    for k, (name, column) in enumerate(list(zip(kinds, columns, strict=True))[1:]):
        there = column != 0.0
        axes[3].plot(distances[there], np.abs(column[there]), ".", color=PALETTE[k], markersize=4 - k, label=name)
    axes[3].set_yscale("log")
    over_time(axes[3], x="distance from the coarse vertex [m]", y="absolute weight")
    figure.savefig(path, dpi=110)
    fit_picture(path)
