"""Which variations end alike: groups of runs by the places of their end states, and within these by the poses."""

from collections.abc import Sequence

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from pdvol.store.reader import Run
from pdvol.studio.wedge.scored_body import ScoredBody, is_whole_run

ALIKE = 0.1  # sizes of the bodies: ends that differ by less are one cluster whatever the others do
LEAST_GAP = 2.0  # a gap between merging distances, over the smaller of the two: by less nothing is separated
ROUND = 1.2  # largest over smallest distance of a surface from its centre: a ball, which looks alike however it rolled


def clusters(runs: Sequence[Run | None]) -> np.ndarray:
    """(n,) int: the cluster of each run by its end state, -1 for runs that ended early, and where there is none.

    Runs are grouped by their `end_state`, and the runs of each group by those of their poses: where bodies went far
    apart, poses would not count beside places. Clusters are numbered by size, equal ones by their first run. Nothing is
    random.
    """
    labels = np.full(len(runs), -1)
    whole = {i: run for i, run in enumerate(runs) if run is not None and is_whole_run(run)}
    meshes: dict[int, list[int]] = {}  # those of one mesh: of others no distance is known
    for i, run in whole.items():
        meshes.setdefault(len(run.levels[-1].rest), []).append(i)
    groups = list(meshes.values())
    for poses in (False, True):
        ends = {i: end_state(run, poses) for i, run in whole.items()}
        groups = [part for group in groups for part in _parts(group, np.array([ends[i] for i in group]))]
    for label, group in enumerate(sorted(groups, key=lambda group: (-len(group), group[0]))):
        labels[group] = label
    return labels


def end_state(run: Run, poses: bool = False) -> np.ndarray:
    """(n d,) a run's end as a point: the distance of two is the root mean square, over the volume at rest, of the
    distance between the same vertices, over the size (diagonal of the box at rest) of the largest body.

    Parameters
    ----------
    poses : whether vertices are taken from their body's centre, so that places do not count; bodies that are round at
        rest have no pose
    """
    everything, bodies = ScoredBody(run, -1), [ScoredBody(run, i) for i in range(len(run.info["bodies"]))]
    end = everything.level.positions(run.info["steps"])
    for body in bodies if poses else ():
        rest = body.level.rest
        reach = np.linalg.norm(rest[np.unique(body.facets)] - body.weights @ rest[body.vertices], axis=1)
        is_round = reach.max() <= ROUND * reach.min()
        end[body.vertices] = 0.0 if is_round else end[body.vertices] - body.weights @ end[body.vertices]
    return (end * np.sqrt(everything.weights)[:, None] / max(body.size for body in bodies)).ravel()


def _parts(group: list[int], ends: np.ndarray) -> list[list[int]]:
    """A group of runs, divided by complete linkage of their ends (k, n d) [sizes] in the widest gap, as a quotient,
    between distances at which parts merge, counted from `ALIKE` on; where none is `LEAST_GAP`, at `ALIKE` times that.
    """
    if len(group) == 1:
        return [group]
    tree = linkage(ends, "complete")
    heights = np.concatenate([[ALIKE], np.sort(tree[:, 2][tree[:, 2] > ALIKE])])
    gaps = heights[1:] / heights[:-1]
    widest = int(np.argmax(gaps)) if len(gaps) else 0
    cut = LEAST_GAP * ALIKE
    if len(gaps) and gaps[widest] >= LEAST_GAP:
        cut = float(np.sqrt(heights[widest] * heights[widest + 1]))
    labels = fcluster(tree, cut, "distance")
    return [[i for i, label in zip(group, labels, strict=True) if label == part] for part in np.unique(labels)]
