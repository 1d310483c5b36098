"""How far the levels of one shot drift apart, run by run: as a table, and as a figure over time.

    ./run python -m benchmarks.divergence runs/ape_direct runs/ape -o divergence.png

The distance of level l from level k is the root mean square, over the volume of level l, of |x_l - P x_k| [m], P the
run's own prolongation from k to l. It is zero at rest, and always zero if level l only follows level k.
"""

import sys
from pathlib import Path

import numpy as np

from benchmarks.common.figures import over_time, panels
from benchmarks.common.study import command
from benchmarks.common.tables import table
from pdvol.errors import InputError
from pdvol.geometry.level_mesh import lumped_masses
from pdvol.measure.metrics import distance
from pdvol.runs.stored_fields import stored_hierarchy
from pdvol.store.reader import Run, open_run
from pdvol.studio.shown import PALETTE


def distances(run: Run) -> dict[tuple[int, int], np.ndarray]:
    """(fine, coarse) -> distance [m] at states 0, 1, ...: of each level from the one below and from level 0."""
    hierarchy, found = stored_hierarchy(run), {}
    for fine in run.levels[1:]:
        volumes = lumped_masses(fine.mesh, np.ones(len(fine.mesh.cells)))
        for coarse in sorted({fine.index - 1, 0}, reverse=True):
            below = run.levels[coarse]
            states = ((fine.positions(n), below.positions(n)) for n in range(min(fine.steps, below.steps)))
            found[fine.index, coarse] = np.array(
                [distance(x, hierarchy.prolong(x_c, coarse, fine.index), volumes) for x, x_c in states]
            )
    return {pair: values for pair, values in found.items() if len(values)}


def rows(name: str, dt: float, found: dict[tuple[int, int], np.ndarray]) -> list[list[str]]:
    """The mean over all states, the mean over the last quarter and the largest [mm], with its time."""
    lines = []
    for (fine, coarse), values in sorted(found.items(), key=lambda item: (item[0][1] == 0, item[0])):
        last = values[-max(len(values) // 4, 1) :]
        largest = f"{1e3 * values.max():.3g} at {values.argmax() * dt:.2f} s"
        means = [f"{1e3 * some.mean():.3g}" for some in (values, last)]
        lines.append([name, f"{fine} from {coarse}", str(len(values) - 1), *means, largest])
    return lines


def draw(path: Path, runs: list[tuple[str, float, dict]]) -> None:
    """Draws each level's distance from level 0 over time, one panel per run, on one scale."""
    figure, ((*axes,),) = panels((4.2 * len(runs), 3.2), 1, len(runs), sharey=True)
    for one, (name, dt, found) in zip(axes, runs, strict=True):
        for (fine, coarse), values in sorted(found.items()):
            if coarse == 0:
                times, colour = dt * np.arange(len(values)), PALETTE[fine % len(PALETTE)]
                one.plot(times, values, color=colour, label=f"level {fine}", linewidth=1.2)
        one.set_ylim(bottom=0.0)
        over_time(one, name, y="RMS distance from level 0 [m]" if one is axes[0] else "")
    figure.savefig(path, dpi=130)


@command(
    "divergence",
    __doc__,
    {"runs": {"nargs": "+", "type": Path, "metavar": "RUN"}, "-o --out": {"type": Path, "metavar": "FILE.png"}},
)
def main(options) -> None:
    """Prints the table and draws the figure."""
    measured = []
    for path in options.runs:
        run = open_run(path)
        found = distances(run)
        if not found:
            raise InputError(f"{path} has no two levels with stored states; run it with --levels 0:1 at least")
        measured.append((f"{run.info['method']} ({path.name})", run.dt, found))
    head = ["run", "level", "steps", "mean [mm]", "last quarter [mm]", "largest [mm]"]
    print(table(head, [line for one in measured for line in rows(*one)]))
    if options.out:
        draw(options.out, measured)


if __name__ == "__main__":
    sys.exit(main())
