"""Small meshes for the tests: rectilinear grids of boxes split into simplices, with some boxes left out."""

from itertools import permutations, product

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.meshes import Solid


def grid(*ticks, keep=None, jitter=0.0, seed=0) -> LevelMesh:
    """Boxes between ticks (one increasing array per axis), each split into d! simplices around its diagonal.

    `keep(i, j[, k])` says which boxes exist. `jitter` moves every point by that share of the smallest spacing.
    """
    ticks = [np.asarray(t, dtype=float) for t in ticks]
    d = len(ticks)
    shape = [len(t) for t in ticks]
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, d)
    cells = []
    for box in product(*(range(n - 1) for n in shape)):
        if keep is not None and not keep(*box):
            continue
        for axes in permutations(range(d)):
            corner = np.array(box)
            path = [corner.copy()]
            for axis in axes:
                corner[axis] += 1
                path.append(corner.copy())
            cells.append([np.ravel_multi_index(p, shape) for p in path])
    used, inverse = np.unique(np.array(cells), return_inverse=True)
    points, cells = points[used], inverse.reshape(-1, d + 1)
    step = min(np.diff(t).min() for t in ticks)
    points = points + jitter * step * np.random.default_rng(seed).uniform(-1, 1, points.shape)
    return level(points, cells)


def level(points, cells, bodies=None) -> LevelMesh:
    """A LevelMesh with positive cells."""
    cells = np.array(cells, dtype=np.int64)
    negative = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells[negative, :2] = cells[negative, 1::-1]
    bodies = np.zeros(len(cells), dtype=np.int32) if bodies is None else np.asarray(bodies, dtype=np.int32)
    return LevelMesh(points, cells, bodies, np.zeros(len(cells), dtype=np.int32))


def together(*meshes: LevelMesh) -> LevelMesh:
    """Bodies 0, 1, ... in one level."""
    offsets = np.cumsum([0] + [len(m.points) for m in meshes[:-1]])
    cells = np.concatenate([m.cells + o for m, o in zip(meshes, offsets, strict=True)])
    bodies = np.repeat(np.arange(len(meshes)), [len(m.cells) for m in meshes])
    return level(np.concatenate([m.points for m in meshes]), cells, bodies)


def box(d, n, low=0.0, high=1.0, jitter=0.0, seed=0) -> LevelMesh:
    """A d-dimensional cube of n boxes a side; `low` and `high` are numbers or arrays of d."""
    low, high = np.broadcast_to(low, d), np.broadcast_to(high, d)
    return grid(*(np.linspace(a, b, n + 1) for a, b in zip(low, high, strict=True)), jitter=jitter, seed=seed)


def solid(d, n, low=0.0, high=1.0) -> Solid:
    """The same as a shape that scenes take."""
    mesh = box(d, n, low, high)
    return Solid(mesh.points, mesh.cells.astype(np.int32), mesh.regions)


def cut_block(size, cuts, place=0.0) -> Solid:
    """A block of these sizes and numbers of boxes along its axes, about a place, as a shape that scenes take."""
    mesh = grid(*(np.linspace(-0.5 * s, 0.5 * s, n + 1) for s, n in zip(size, cuts, strict=True)))
    return Solid(mesh.points + place, mesh.cells.astype(np.int32), mesh.regions)


def _ticks(ends, n):
    return np.concatenate(
        [np.linspace(a, b, n + 1)[:-1] for a, b in zip(ends[:-1], ends[1:], strict=True)] + [ends[-1:]]
    )


def comb(d, n, teeth, height, base=0.3) -> LevelMesh:
    """A comb: teeth [(left, right), ...] on a base of thickness `base`, upwards to `height`; n boxes across a tooth and
    a gap.
    """
    x = _ticks(np.ravel(teeth), n)
    y = np.r_[np.linspace(0.0, base, n + 1), np.linspace(base, height, 4 * n + 1)[1:]]
    depth = [np.linspace(0.0, 0.4, n + 1)] * (d - 2)
    return grid(x, y, *depth, keep=lambda i, j, *_: j < n or (i // n) % 2 == 0)


def comb_branch(points, teeth, base=0.3):
    """The tooth of each point or centroid, -1 in the base or within 0.15 of it."""
    middles = np.array([(-np.inf if k == 0 else (teeth[k - 1][1] + teeth[k][0]) / 2) for k in range(len(teeth))])
    return np.where(points[:, 1] > base + 0.15, np.searchsorted(middles, points[:, 0]) - 1, -1)


def fold(d, n, lower, upper, right=1.0, left=0.0) -> LevelMesh:
    """A U-turn lying on its side: two arms, `lower` and `upper` = (bottom, top), from `left` to a bend at `right`."""
    x = np.r_[np.linspace(left, right, 5 * n + 1), np.linspace(right, right + 0.3, n + 1)[1:]]
    y = _ticks(np.r_[lower, upper], n)
    depth = [np.linspace(0.0, 0.4, n + 1)] * (d - 2)
    return grid(x, y, *depth, keep=lambda i, j, *_: i >= 5 * n or j // n != 1)


def fold_branch(points, lower, upper, right=1.0):
    """0 in the lower arm, 1 in the upper one, -1 in the bend or within 0.15 of it."""
    return np.where(points[:, 0] < right - 0.15, (points[:, 1] > (lower[1] + upper[0]) / 2).astype(int), -1)
