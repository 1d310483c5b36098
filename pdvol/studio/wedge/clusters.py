"""Which variations end alike: groups of runs by the places of their end states, and within these by the poses."""

from collections.abc import Sequence

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from pdvol.store.reader import Run
from pdvol.studio.wedge.scored_body import ScoredBody, is_whole_run

ALIKE = 0.1  # sizes of the bodies: ends that differ by less are one cluster whatever the others do
LEAST_GAP = 2.0  # a gap between merging distances, over the smaller of the two: by less nothing is set apart
ROUND = 1.2  # largest over smallest distance of a surface from its centre: a ball, which looks alike however it rolled


def end_distances(runs: Sequence[Run], poses: bool = False) -> np.ndarray:
    """(n, n): how far apart runs end: the root mean square, over the volume at rest, of the distance between the same
    points at the end, over the size (diagonal of the box at rest) of all bodies together or of the largest one,
    whichever is smaller. NaN with a run that ended early.

    All runs are of one scene and have the same finest level's mesh, perhaps placed differently.

    Parameters
    ----------
    poses : whether to measure distances from each body's centre, so that places do not count; bodies that are round at
        rest have no pose
    """
    ends: list[np.ndarray | None] = []
    for run in runs:
        everything = ScoredBody(run, -1)
        if not is_whole_run(run):
            ends.append(None)
            continue
        size = max(ScoredBody(run, i).size for i in range(len(run.info["bodies"])))
        end = everything.level.positions(run.info["steps"])
        end = _pose(run, end) if poses else end
        ends.append(end * np.sqrt(everything.weights)[:, None] / size)
    n = len(runs)
    distances = np.full((n, n), np.nan)
    for i, one in enumerate(ends):
        for j, other in enumerate(ends[: i + 1]):
            if one is not None and other is not None and one.shape == other.shape:
                distances[i, j] = distances[j, i] = np.linalg.norm(one - other)
    return distances


def _pose(run: Run, end: np.ndarray) -> np.ndarray:
    """(n, d) [m]: the vertices at the end from the centres of their bodies; zero for round bodies."""
    pose = np.zeros_like(end)
    for body in (ScoredBody(run, i) for i in range(len(run.info["bodies"]))):
        rest = body.level.rest
        reach = np.linalg.norm(rest[np.unique(body.facets)] - body.weights @ rest[body.vertices], axis=1)
        if reach.max() > ROUND * reach.min():
            pose[body.vertices] = end[body.vertices] - body.weights @ end[body.vertices]
    return pose


def clusters(runs: Sequence[Run]) -> np.ndarray:
    """(n,) int: the cluster of each run by its end state, -1 for runs that ended early.

    Runs are grouped by their `end_distances`, and the runs of each group by those of their poses: where bodies went far
    apart, poses would not count beside places. Clusters are numbered by size, equal ones by their first run. Nothing is
    random.
    """
    distances = end_distances(runs)
    whole = np.flatnonzero(~np.isnan(np.diag(distances)))
    labels = np.full(len(runs), -1)
    if len(whole) == 0:
        return labels
    places = _grouped(distances[np.ix_(whole, whole)])
    poses = end_distances([runs[i] for i in whole], poses=True)
    found = np.zeros(len(whole), dtype=int)
    for place in np.unique(places):
        mine = np.flatnonzero(places == place)
        found[mine] = _grouped(poses[np.ix_(mine, mine)]) + found.max()
    order = sorted(set(found.tolist()), key=lambda c: (-np.sum(found == c), np.flatnonzero(found == c)[0]))
    labels[whole] = [order.index(c) for c in found.tolist()]
    return labels


def _grouped(distances: np.ndarray) -> np.ndarray:
    """(n,) int, from 1: groups by distances (n, n) [sizes], NaN where two can have none.

    Complete linkage: no two of a group are further apart than the height at which it is cut. It is cut in the middle of
    the widest gap, as a quotient, between distances at which groups merge, counted from `ALIKE` on; where no gap is
    `LEAST_GAP`, at `ALIKE` times that.
    """
    if len(distances) == 1:
        return np.ones(1, dtype=int)
    tree = linkage(squareform(np.nan_to_num(distances, nan=1e6), checks=False), "complete")
    return fcluster(tree, _cut(tree[:, 2]), "distance")


def _cut(heights: np.ndarray) -> float:
    """The height [sizes] at which the tree is cut."""
    steps = np.concatenate([[ALIKE], np.sort(heights[heights > ALIKE])])
    quotients = steps[1:] / steps[:-1]
    if len(quotients) == 0 or quotients.max() < LEAST_GAP:
        return LEAST_GAP * ALIKE
    widest = int(np.argmax(quotients))
    return float(np.sqrt(steps[widest] * steps[widest + 1]))
