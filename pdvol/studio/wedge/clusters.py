"""Which variations end alike: groups of runs by their end states."""

from collections.abc import Sequence

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from pdvol.store.reader import Run
from pdvol.studio.wedge.scored_body import ScoredBody, is_whole_run

ALIKE = 0.1  # sizes of the bodies: ends that differ by less are one cluster whatever the others do
LEAST_GAP = 2.0  # a gap between merging distances, over the smaller of the two: by less nothing is set apart


def end_distances(runs: Sequence[Run]) -> np.ndarray:
    """(n, n): how far apart runs end: the root mean square, over the volume at rest, of the distance between the same
    points at the end, over the size (diagonal of the box at rest) of all bodies together or of the largest one,
    whichever is smaller. NaN with a run that ended early.

    All runs are of one scene and have the same finest level's mesh, perhaps placed differently.
    """
    ends: list[np.ndarray | None] = []
    for run in runs:
        everything = ScoredBody(run, -1)
        if not is_whole_run(run):
            ends.append(None)
            continue
        size = max(ScoredBody(run, i).size for i in range(len(run.info["bodies"])))
        ends.append(everything.level.positions(run.info["steps"]) * np.sqrt(everything.weights)[:, None] / size)
    n = len(runs)
    distances = np.full((n, n), np.nan)
    for i, one in enumerate(ends):
        for j, other in enumerate(ends[: i + 1]):
            if one is not None and other is not None and one.shape == other.shape:
                distances[i, j] = distances[j, i] = np.linalg.norm(one - other)
    return distances


def clusters(runs: Sequence[Run]) -> np.ndarray:
    """(n,) int: the cluster of each run by its end state, -1 for runs that ended early.

    Complete linkage on `end_distances`: no two ends of a cluster are further apart than the height at which it is cut.
    It is cut in the middle of the widest gap, as a quotient, between distances at which clusters merge, counted from
    `ALIKE` on; where no gap is `LEAST_GAP`, at `ALIKE` times that. Clusters are numbered by size, equal ones by their
    first run. Nothing is random.
    """
    distances = end_distances(runs)
    whole = np.flatnonzero(~np.isnan(np.diag(distances)))
    labels = np.full(len(runs), -1)
    if len(whole) == 0:
        return labels
    among = np.nan_to_num(distances[np.ix_(whole, whole)], nan=1e6)
    found = np.ones(1, dtype=int)
    if len(whole) > 1:
        tree = linkage(squareform(among, checks=False), "complete")
        found = fcluster(tree, _cut(tree[:, 2]), "distance")
    order = sorted(set(found.tolist()), key=lambda c: (-np.sum(found == c), np.flatnonzero(found == c)[0]))
    labels[whole] = [order.index(c) for c in found.tolist()]
    return labels


def _cut(heights: np.ndarray) -> float:
    """The height [sizes] at which the tree is cut."""
    steps = np.concatenate([[ALIKE], np.sort(heights[heights > ALIKE])])
    quotients = steps[1:] / steps[:-1]
    if len(quotients) == 0 or quotients.max() < LEAST_GAP:
        return LEAST_GAP * ALIKE
    widest = int(np.argmax(quotients))
    return float(np.sqrt(steps[widest] * steps[widest + 1]))
