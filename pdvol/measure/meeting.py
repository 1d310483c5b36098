"""Which segments and triangles meet, independently of the solver: a uniform grid finds the candidates, and orientation
signs decide: in floating point where the round-off bound allows it, in rational numbers elsewhere. Touching counts.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations

import numpy as np

ExactPoint = tuple[Fraction, ...]

ROUND_OFF = 1e-14
"""Relative error, above the round-off of a 3 x 3 determinant of differences (Shewchuk 1997: 8e-16 times the sum of
absolute products): signs of smaller values are computed again in rational numbers.
"""
CELLS_PER_BOX = 30
"""Grid cells a box covers on average, at most: it bounds the memory."""


# ---- broad phase


def overlapping_boxes(low_a: np.ndarray, high_a: np.ndarray, low_b: np.ndarray, high_b: np.ndarray) -> np.ndarray:
    """Pairs (k, 2) of boxes that meet, the first of a, the second of b, by a uniform grid; corners are (n, d) [m]."""
    none = np.empty((0, 2), dtype=np.int64)
    if len(low_a) == 0 or len(low_b) == 0:
        return none
    low, high = np.maximum(low_a.min(0), low_b.min(0)), np.minimum(high_a.max(0), high_b.max(0))
    if (low > high).any():
        return none
    keep_a, keep_b = (
        np.flatnonzero(((lo <= high) & (hi >= low)).all(1)) for lo, hi in ((low_a, high_a), (low_b, high_b))
    )
    if len(keep_a) == 0 or len(keep_b) == 0:
        return none
    extents = np.concatenate([(high_a - low_a)[keep_a].max(1), (high_b - low_b)[keep_b].max(1)])
    size = max(float(np.quantile(extents, 0.75)), float((high - low).max()) / 500, 1e-300)
    boxes = np.concatenate([low_a[keep_a], low_b[keep_b]]), np.concatenate([high_a[keep_a], high_b[keep_b]])
    while _entries(*boxes, low, high, size) > CELLS_PER_BOX * len(extents):
        size *= 2.0  # long needles among short edges
    counts = np.floor((high - low) / size).astype(np.int64) + 1

    def entries(lo: np.ndarray, hi: np.ndarray, keep: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        first = np.floor((np.clip(lo[keep], low, high) - low) / size).astype(np.int64)
        spans = np.floor((np.clip(hi[keep], low, high) - low) / size).astype(np.int64) - first + 1
        many = spans.prod(1)
        which = np.repeat(np.arange(len(keep)), many)
        inner = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
        key = np.zeros(len(which), dtype=np.int64)
        for axis in range(lo.shape[1]):
            inner, offset = np.divmod(inner, spans[which, axis])
            key = key * counts[axis] + first[which, axis] + offset
        return key, keep[which]

    key_a, of_a = entries(low_a, high_a, keep_a)
    key_b, of_b = entries(low_b, high_b, keep_b)
    order = np.argsort(key_b, kind="stable")
    key_b, of_b = key_b[order], of_b[order]
    begin, end = np.searchsorted(key_b, key_a, "left"), np.searchsorted(key_b, key_a, "right")
    many = end - begin
    a = np.repeat(of_a, many)
    b = of_b[np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many) + np.repeat(begin, many)]
    meet = ((low_a[a] <= high_b[b]) & (low_b[b] <= high_a[a])).all(1)
    return np.column_stack(np.divmod(np.unique(a[meet] * len(low_b) + b[meet]), len(low_b)))


def _entries(lo: np.ndarray, hi: np.ndarray, low: np.ndarray, high: np.ndarray, size: float) -> float:
    """Grid cells that boxes cover, counted as often as they do."""
    spans = np.floor((np.clip(hi, low, high) - low) / size) - np.floor((np.clip(lo, low, high) - low) / size) + 1.0
    return float(spans.prod(1).sum())


def _boxes(points: np.ndarray, simplices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    corners = points[simplices]
    return corners.min(1), corners.max(1)


def _candidates(points: np.ndarray, first: np.ndarray, second: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """Pairs of simplices whose boxes meet, that share no vertex and of which one at least is a body's."""
    pairs = overlapping_boxes(*_boxes(points, first), *_boxes(points, second))
    a, b = first[pairs[:, 0]], second[pairs[:, 1]]
    apart = ~(a[:, :, None] == b[:, None, :]).any((1, 2))
    return pairs[apart & (moves[a[:, 0]] | moves[b[:, 0]])]


# ---- signs


def _orientation(*corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sign of the simplices' volume, and where round-off leaves it open; corners are d + 1 arrays (k, d)."""
    rows = np.stack([c - corners[0] for c in corners[1:]], axis=1)
    absolute = np.abs(rows)
    if rows.shape[1] == 2:
        value = rows[:, 0, 0] * rows[:, 1, 1] - rows[:, 0, 1] * rows[:, 1, 0]
        bound = absolute[:, 0, 0] * absolute[:, 1, 1] + absolute[:, 0, 1] * absolute[:, 1, 0]
    else:
        value = np.einsum("ij,ij->i", rows[:, 0], np.cross(rows[:, 1], rows[:, 2]))
        u, v = absolute[:, 1], absolute[:, 2]
        bound = np.einsum(
            "ij,ij->i", absolute[:, 0], u[:, [1, 2, 0]] * v[:, [2, 0, 1]] + u[:, [2, 0, 1]] * v[:, [1, 2, 0]]
        )
    return np.sign(value).astype(int), np.abs(value) <= ROUND_OFF * bound


def _exact_orientation(*corners: ExactPoint) -> int:
    rows = [[c - o for c, o in zip(corner, corners[0], strict=True)] for corner in corners[1:]]
    if len(rows) == 2:
        value = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]
    else:
        (a, b, c), (d, e, f), (g, h, i) = rows
        value = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return (value > 0) - (value < 0)


def _rational(points: Sequence[np.ndarray]) -> list[ExactPoint]:
    return [tuple(Fraction(float(c)) for c in p) for p in points]


def segments_meet(*corners: np.ndarray) -> bool:
    """Whether two 2D segments meet, in rational numbers; four corners (2,)."""
    p, q, r, s = _rational(corners)
    return _segments_meet_exactly(p, q, r, s)


def _segments_meet_exactly(p: ExactPoint, q: ExactPoint, r: ExactPoint, s: ExactPoint) -> bool:
    a, b, c, d = (
        _exact_orientation(p, q, r),
        _exact_orientation(p, q, s),
        _exact_orientation(r, s, p),
        _exact_orientation(r, s, q),
    )
    if a == b == c == d == 0:
        return all(max(min(p[k], q[k]), min(r[k], s[k])) <= min(max(p[k], q[k]), max(r[k], s[k])) for k in range(2))
    return a * b <= 0 and c * d <= 0


def segment_meets_triangle(*corners: np.ndarray) -> bool:
    """Whether a segment and a triangle meet, in rational numbers; the five corners (3,), the segment's first."""
    p, q, a, b, c = _rational(corners)
    above, below = _exact_orientation(a, b, c, p), _exact_orientation(a, b, c, q)
    if above == below == 0:
        return _coplanar_meet(p, q, a, b, c)
    if above * below > 0:
        return False
    signs = {_exact_orientation(p, q, a, b), _exact_orientation(p, q, b, c), _exact_orientation(p, q, c, a)}
    return not {1, -1} <= signs


def _coplanar_meet(p: ExactPoint, q: ExactPoint, a: ExactPoint, b: ExactPoint, c: ExactPoint) -> bool:
    """Of exactly coplanar ones, in the coordinate plane where the triangle keeps an area."""
    for x, y in ((0, 1), (1, 2), (0, 2)):
        flat = [(v[x], v[y]) for v in (p, q, a, b, c)]
        turn = _exact_orientation(*flat[2:])
        if turn == 0:
            continue
        if any(_segments_meet_exactly(flat[0], flat[1], start, end) for start, end in combinations(flat[2:], 2)):
            return True
        sides = [_exact_orientation(flat[2 + i], flat[2 + (i + 1) % 3], flat[0]) * turn for i in range(3)]
        return min(sides) >= 0
    return False


# ---- narrow phase


def crossing_segments(points: np.ndarray, edges: np.ndarray, moves: np.ndarray) -> list[tuple[int, ...]]:
    """Pairs of 2D segments that meet, as their four vertices; of each pair at least one vertex `moves` (n,) bool."""
    pairs = _candidates(points, edges, edges, moves)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    p, q, r, s = (points[edges[pairs[:, i], k]] for i in (0, 1) for k in (0, 1))
    a, b, c, d = (_orientation(*three) for three in ((p, q, r), (p, q, s), (r, s, p), (r, s, q)))
    apart = _surely_one_sided(a, b) | _surely_one_sided(c, d)
    open_ = ~apart & (a[1] | b[1] | c[1] | d[1])
    meet = ~apart & ~open_
    for k in np.flatnonzero(open_):
        meet[k] = segments_meet(p[k], q[k], r[k], s[k])
    return [(*map(int, edges[i]), *map(int, edges[j])) for i, j in pairs[meet]]


def crossing_edges(
    points: np.ndarray, edges: np.ndarray, faces: np.ndarray, moves: np.ndarray
) -> list[tuple[int, ...]]:
    """Edges and triangles that meet, as their five vertices; `moves` as for `crossing_segments`."""
    pairs = _candidates(points, edges, faces, moves)
    above = _orientation(*(points[faces[pairs[:, 1], k]] for k in range(3)), points[edges[pairs[:, 0], 0]])
    below = _orientation(*(points[faces[pairs[:, 1], k]] for k in range(3)), points[edges[pairs[:, 0], 1]])
    near = ~_surely_one_sided(above, below)
    pairs, unsure = pairs[near], (above[1] | below[1])[near]
    p, q = (points[edges[pairs[:, 0], k]] for k in (0, 1))
    a, b, c = (points[faces[pairs[:, 1], k]] for k in range(3))
    near = ~_separated(p, q, a, b, c)
    pairs, unsure, p, q, a, b, c = (array[near] for array in (pairs, unsure, p, q, a, b, c))
    around = [_orientation(p, q, *two) for two in ((a, b), (b, c), (c, a))]
    signs, open_ = np.array([s for s, _ in around]), np.array([o for _, o in around])
    apart = ((signs > 0) & ~open_).any(0) & ((signs < 0) & ~open_).any(0)
    open_ = ~apart & (unsure | open_.any(0))
    meet = ~apart & ~open_
    for k in np.flatnonzero(open_):
        meet[k] = segment_meets_triangle(p[k], q[k], a[k], b[k], c[k])
    return [(*map(int, edges[i]), *map(int, faces[j])) for i, j in pairs[meet]]


def _surely_one_sided(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    return (one[0] == other[0]) & (one[0] != 0) & ~one[1] & ~other[1]


def _separated(p: np.ndarray, q: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Segments that an axis within the triangle's plane keeps well apart from it: this decides flat regions without
    rational numbers.
    """
    normal = np.cross(b - a, c - a)
    size = np.max([np.abs(v - a).max(1) for v in (p, q, b, c)], axis=0)
    reach = np.max([np.abs(v).max(1) for v in (p, q, a, b, c)], axis=0)
    apart = np.zeros(len(p), dtype=bool)
    for direction in (b - a, c - b, a - c, q - p):
        axis = np.cross(normal, direction)
        axis /= np.linalg.norm(axis, axis=1, keepdims=True) + 1e-300
        s = np.stack([np.einsum("ij,ij->i", v - a, axis) for v in (p, q)])
        t = np.stack([np.einsum("ij,ij->i", v - a, axis) for v in (a, b, c)])
        apart |= np.maximum(s.min(0) - t.max(0), t.min(0) - s.max(0)) > 1e-12 * (size + reach)
    return apart
