"""How far the levels of one shot drift apart, run by run: as a table, and as a figure over time.

    ./run python -m benchmarks.divergence runs/ape_direct runs/ape -o divergence.png

The distance of level l from level k is the root mean square, over the volume of level l, of |x_l - P x_k| [m], P the
prolongation from k to l (barycentric, the product of those in between). It is zero at rest, and always zero if level l
only follows level k.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpi4py import MPI

from benchmarks.common import process
from pdvol.errors import InputError
from pdvol.geometry.level_mesh import lumped_masses
from pdvol.levels.hierarchy import Hierarchy
from pdvol.measure.metrics import distance
from pdvol.store.reader import Run, open_run
from pdvol.studio.draw.layout import BACKGROUND
from pdvol.studio.shown import PALETTE


def distances(run: Run) -> dict[tuple[int, int], np.ndarray]:
    """(fine, coarse) -> distance [m] at states 0, 1, ...: of each level from the one below and from level 0."""
    hierarchy = Hierarchy([level.mesh for level in run.levels], MPI.COMM_SELF)
    found = {}
    for fine in run.levels[1:]:
        volumes = lumped_masses(fine.mesh, np.ones(len(fine.mesh.cells)))
        for coarse in sorted({fine.index - 1, 0}, reverse=True):
            below = run.levels[coarse]
            states = ((fine.positions(n), below.positions(n)) for n in range(min(fine.steps, below.steps)))
            found[fine.index, coarse] = np.array(
                [distance(x, hierarchy.prolong(x_c, coarse, fine.index), volumes) for x, x_c in states]
            )
    return {pair: values for pair, values in found.items() if len(values)}


def table(name: str, dt: float, found: dict[tuple[int, int], np.ndarray]) -> str:
    """Rows of a Markdown table: the mean over all states, the mean over the last quarter and the largest [mm], with its
    time.
    """
    rows = []
    for (fine, coarse), values in sorted(found.items(), key=lambda item: (item[0][1] == 0, item[0])):
        late = values[-max(len(values) // 4, 1) :]
        rows.append(
            f"| {name} | {fine} from {coarse} | {len(values) - 1} | {1e3 * values.mean():.3g} | {1e3 * late.mean():.3g}"
            f" | {1e3 * values.max():.3g} at {values.argmax() * dt:.2f} s |"
        )
    return "\n".join(rows)


def draw(path: Path, runs: list[tuple[str, float, dict]]) -> None:
    """Draws each level's distance from level 0 over time, one panel per run, on one scale."""
    figure = Figure(figsize=(4.2 * len(runs), 3.2), facecolor=BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(runs), sharey=True, squeeze=False)[0]
    for axes, (name, dt, found) in zip(panels, runs, strict=True):
        axes.set_facecolor(BACKGROUND)
        for (fine, coarse), values in sorted(found.items()):
            if coarse == 0:
                axes.plot(
                    dt * np.arange(len(values)),
                    values,
                    color=PALETTE[fine % len(PALETTE)],
                    label=f"level {fine}",
                    linewidth=1.2,
                )
        axes.set_title(name, fontsize=10, loc="left")
        axes.set_xlabel("time [s]", fontsize=8)
        axes.set_ylim(bottom=0.0)
        axes.tick_params(labelsize=8)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(fontsize=8, frameon=False)
    panels[0].set_ylabel("RMS distance from level 0 [m]", fontsize=8)
    figure.savefig(path, dpi=130)


def main(words: list[str]) -> int:
    """Prints the table and draws the figure; returns 2 where a folder is no run of several levels."""
    parser = process.parser("divergence", __doc__)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN")
    parser.add_argument("-o", "--out", type=Path, metavar="FILE.png")
    options = parser.parse_args(words)
    measured = []
    try:
        for path in options.runs:
            run = open_run(path)
            found = distances(run)
            if not found:
                raise InputError(f"{path} has no two levels with stored states; run it with --levels 0:1 at least")
            measured.append((f"{run.info['method']} ({path.name})", run.dt, found))
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    print("| run | level | steps | mean [mm] | last quarter [mm] | largest [mm] |\n|---|---|---|---|---|---|")
    print("\n".join(table(*one) for one in measured))
    if options.out:
        draw(options.out, measured)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
