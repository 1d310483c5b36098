"""How near two bodies come, on each level and where level 0 is only embedded in the next one (paper, figure "contact
geometry resolution and conformity").
"""

from collections.abc import Mapping

import numpy as np

from benchmarks.common.tables import table
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.wedge.variation import length

NEAREST = 100
"""Number of vertices whose mean gap is given: about those of the gnome's finer level that touch."""
CLOSE = 1e-3
"""Gap [m] below which a vertex counts as touching: that of contact on this scene, which begins at its `dhat`."""


def meeting(run: Run, bodies: tuple[int, int]) -> dict[str, list[str]]:
    """Rows of figures at the end of a run: of level 0, of the level above it, and of the same level embedded."""
    from mpi4py import MPI

    from pdvol.levels.hierarchy import Hierarchy

    coarse, fine = run.levels[:2]
    pair = Hierarchy([level.mesh for level in (coarse, fine)], MPI.COMM_SELF, run.info["prolongation"])
    last = run.info["steps"]
    embedded = pair.prolong(coarse.positions(last), 0, 1)
    found = [
        gaps_between(coarse, coarse.positions(last), bodies),
        gaps_between(fine, fine.positions(last), bodies),
        gaps_between(fine, embedded, bodies),
    ]
    owners = fine.mesh.point_bodies
    apart = [float(np.linalg.norm((fine.positions(last) - embedded)[owners == body].mean(axis=0))) for body in bodies]
    names = [str(run.info["bodies"][body]) for body in bodies]
    return {
        f"mean gap of the {NEAREST} nearest vertices of the {names[0]}": [
            "",  # its vertices are too far from each other for this
            *(length(float(np.sort(gaps)[:NEAREST].mean())) for gaps in found[1:]),
        ],
        f"smallest gap to the {names[1]}": [_smallest(float(gaps.min())) for gaps in found],
        f"vertices within {length(CLOSE)}": [str(int(((gaps >= 0.0) & (gaps < CLOSE)).sum())) for gaps in found],
        f"vertices inside the {names[1]}": [str(int((gaps < 0.0).sum())) for gaps in found],
        f"distance between the centres of levels 0 and 1: {names[0]}, {names[1]}": [
            "",
            ", ".join(length(distance) for distance in apart),
            "0 mm",
        ],
    }


def gaps_between(level: RunLevel, positions: np.ndarray, bodies: tuple[int, int]) -> np.ndarray:
    """(n,) [m]: from each vertex of the first body's surface to that of the second; negative inside it."""
    import igl

    owners = level.mesh.point_bodies[level.surface[:, 0]]
    vertices = np.unique(level.surface[owners == bodies[0]])
    return np.asarray(
        igl.signed_distance(
            np.ascontiguousarray(positions[vertices]),
            np.ascontiguousarray(positions),
            np.ascontiguousarray(level.surface[owners == bodies[1]], dtype=np.int64),
        )[0]
    )


def table_of_meetings(rows: Mapping[str, dict[str, list[str]]]) -> str:
    """Markdown: for each run, by its name, columns of level 0, level 1 and the embedded one."""
    head = ["", *(f"{name}: {which}" for name in rows for which in ("level 0", "level 1", "level 1, only embedded"))]
    names = next(iter(rows.values()))
    return table(head, [[name, *(cell for found in rows.values() for cell in found[name])] for name in names])


def _smallest(gap: float) -> str:
    return length(gap) if gap >= 0.0 else f"-{length(-gap)}"
