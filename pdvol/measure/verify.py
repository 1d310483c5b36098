"""An independent check of stored runs: no intersection, no vertex below a plane, no inverted cell in any state.

It has no code of the solver, of the checks before a run, or with ipctk: it imports numpy and the reader of run
folders only (a test). `meeting.py` decides what meets; touching counts as an intersection. Primitives with a common
vertex are not tested, nor are obstacles among themselves.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.measure.meeting import crossing_edges, crossing_segments
from pdvol.store.reader import open_run

LISTED_PRIMITIVES = 5
"""Cells or pairs named in one problem."""


def boundary(cells: np.ndarray) -> np.ndarray:
    """Facets (k, d) that belong to one cell (m, d + 1) only."""
    facets = np.concatenate([np.delete(cells, k, axis=1) for k in range(cells.shape[1])])
    facets, counts = np.unique(np.sort(facets, axis=1), axis=0, return_counts=True)
    return facets[counts == 1]


def edges_of(facets: np.ndarray) -> np.ndarray:
    """Edges (e, 2) of segments or triangles (k, d), once each."""
    if facets.shape[1] == 2:
        return facets
    return np.unique(np.sort(np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]]), axis=1), axis=0)


def signed_volumes(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(m,) signed volumes of cells (m, d + 1), times d!."""
    return np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]])


def crossings(
    points: np.ndarray, facets: np.ndarray, solids: Sequence[tuple[np.ndarray, np.ndarray]] = ()
) -> list[tuple[tuple[str, int], ...]]:
    """Crossings of a level's boundary with itself and with obstacles.

    Parameters
    ----------
    points : (n, d) [m]
    facets : (k, d)
    solids : (vertices, facets) of each obstacle

    Returns
    -------
    list
        For each crossing its vertices, as ("vertex", number) or ("obstacle <i>", number).
    """
    used, facets = np.unique(facets, return_inverse=True)
    facets = facets.reshape(-1, points.shape[1])
    everything: list[np.ndarray] = [points[used]]
    parts: list[np.ndarray] = [facets]
    total, names = len(used), [("vertex", int(v)) for v in used]
    for i, (vertices, its) in enumerate(solids):
        parts.append(np.asarray(its, dtype=np.int64) + total)
        everything.append(vertices)
        names += [(f"obstacle {i}", v) for v in range(len(vertices))]
        total += len(vertices)
    points, facets = np.vstack(everything), np.vstack(parts)
    moves = np.arange(total) < len(used)
    if points.shape[1] == 2:
        found = crossing_segments(points, facets, moves)
    else:
        found = crossing_edges(points, edges_of(facets), facets, moves)
    return [tuple(names[v] for v in one) for one in found]


class LevelFindings:
    """The findings at one level.

    Attributes
    ----------
    index : the level
    problems : list of str, one line each
    steps : states checked
    crossings : pairs of primitives that meet, in all states
    smallest_gap : of a vertex above a plane [m]
    smallest_det : of a cell's deformation gradient
    """

    def __init__(self, index: int):
        self.index = index
        self.problems: list[str] = []
        self.steps, self.crossings, self.smallest_gap, self.smallest_det = 0, 0, np.inf, np.inf

    def summary(self) -> str:
        """One line: states, extremes and intersections."""
        return (
            f"level {self.index}: {self.steps} states, smallest plane gap {self.smallest_gap:.3g} m, smallest det F"
            f" {self.smallest_det:.3g}, {self.crossings} intersections"
        )


def check_state(
    found: LevelFindings,
    step: int,
    rest: np.ndarray,
    cells: np.ndarray,
    facets: np.ndarray,
    positions: np.ndarray,
    planes: Sequence[tuple[str, np.ndarray, np.ndarray]] = (),
    solids: Sequence[tuple[np.ndarray, np.ndarray]] = (),
) -> None:
    """Check one state and add its findings to `found`.

    Parameters
    ----------
    rest, positions : (n, d) [m]
    cells : (m, d + 1)
    facets : (k, d), the boundary
    planes : (name, point, normal) of each plane
    solids : (vertices, facets) of each other obstacle
    """
    where = f"level {found.index} step {step}"
    found.steps += 1
    if positions.shape != rest.shape or not np.isfinite(positions).all():
        found.problems.append(f"{where}: positions are not {rest.shape} finite numbers")
        return
    for name, point, normal in planes:
        height = (positions - point) @ (normal / np.linalg.norm(normal))
        found.smallest_gap = min(found.smallest_gap, float(height.min()))
        below = np.flatnonzero(~(height > 0))
        if len(below):
            found.problems.append(
                f"{where}: {len(below)} vertices not above plane {name!r}, the worst {height.argmin()} by"
                f" {height.min():.3g} m"
            )
    ratio = signed_volumes(positions, cells) / signed_volumes(rest, cells)
    found.smallest_det = min(found.smallest_det, float(ratio.min()))
    inverted = np.flatnonzero(~(ratio > 0))
    if len(inverted):
        found.problems.append(
            f"{where}: {len(inverted)} inverted or flat cells, {inverted[:LISTED_PRIMITIVES].tolist()},"
            f" det F {ratio.min():.3g}"
        )
    pairs = crossings(positions, facets, solids)
    found.crossings += len(pairs)
    if pairs:
        named = "; ".join(" ".join(f"{kind} {v}" for kind, v in pair) for pair in pairs[:LISTED_PRIMITIVES])
        found.problems.append(f"{where}: {len(pairs)} intersections: {named}")


def check_levels(
    path: str | Path, every: int = 1, say: Callable[[str], None] = lambda _: None
) -> Iterator[LevelFindings]:
    """The findings at each level of a run folder, in every `every`-th state from the first on and in the last one;
    `say` is called with how far the checks are, in a few words.

    Raises
    ------
    InputError
        The folder is no run, or a file that all states need is damaged; a damaged state is a finding.
    """
    run = open_run(path)
    for level in run.levels:
        found = LevelFindings(level.index)
        rest, cells = level.rest, level.cells
        facets = boundary(cells)
        states = level.steps
        if level.info["state"] == "done" and states != run.info["steps"] + 1:
            found.problems.append(f"level {level.index}: done, with {states} states of {run.info['steps'] + 1}")
        for step in sorted({*range(0, states, every), *range(states)[-1:]}):
            say(f"level {level.index}, step {step} of {states - 1}")
            placed = level.placed(run.obstacles, step)
            planes = [(o.name, *o.plane(step)) for o in placed if o.kind == "plane"]
            solids = [
                (o.vertices(step), o.arrays["faces" if o.kind == "mesh" else "edges"])
                for o in placed
                if o.kind != "plane"
            ]
            try:
                positions = level.positions(step)
            except InputError as error:
                found.problems.append(f"level {level.index} step {step}: {error}")
                continue
            check_state(found, step, rest, cells, facets, positions, planes, solids)
        yield found


def verify_run(path: str | Path) -> list[str]:
    """The defects of a run folder, one line each; empty where all states are sound. Raises as `check_levels`."""
    return [problem for level in check_levels(path) for problem in level.problems]
