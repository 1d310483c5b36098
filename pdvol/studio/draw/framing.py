"""What a picture frames: what is in the scene most of the time, as arrays.

A sample is the box of one body at one step on one level. A body's usual box reaches, axis by axis, from the 10 %
quantile of its samples' lower bounds to the 90 % quantile of their upper ones. The core reaches from the lower
quartile of the usual boxes' lower bounds to the upper quartile of their upper ones. A sample is framed where its
middle is no further from the core than 1.5 times the core's longest side. One body of many that goes far is thus framed
as long as it is near the others, and does not make them small afterwards. Fewer than four bodies are framed always:
where one of them goes, a throw or a fall is the shot. So are all bodies where that takes at most 2.5 times the room.

An obstacle is framed at the steps at which its box is within reach of the framed samples: as a whole where it is not
much larger than they are together, else only the part within reach.
"""

from collections.abc import Iterable, Sequence

import numpy as np

RARE = 0.1  # fraction of a body's samples that may lie beyond each side of its usual box: short absences do not count
FEW = 0.25  # fraction of the bodies that may lie beyond each side of the core; one of fewer than four is more than that
# times the longest side of what is framed: the others stay large enough beside a body that goes that far
MOST_ROOM = 2.5
CORE_REACH = 1.5  # longest sides of the core: a row of equal distances is within, and most bodies' falls are
OBSTACLE_REACH = 0.3  # fraction of the bodies' diagonal within which obstacles count: a floor mesh may be far larger
LARGEST_WHOLE = 2.0  # the bodies' diagonals: an obstacle up to this size is framed whole
_OUTLINE_DIRECTIONS = 100  # in which a body's outermost points are kept: a ball appears 4 % too small at most


def outermost(points: np.ndarray) -> np.ndarray:
    """The points (k, 3) that lie outermost in evenly spread directions, and those at the bounds of each axis."""
    if len(points) <= _OUTLINE_DIRECTIONS:
        return points
    found = np.concatenate([(points @ _directions().T).argmax(axis=0), points.argmin(axis=0), points.argmax(axis=0)])
    return points[np.unique(found)]


def _directions() -> np.ndarray:
    """Unit vectors on a Fibonacci spiral, shape (n, 3)."""
    i = np.arange(_OUTLINE_DIRECTIONS) + 0.5
    height, turn = 1.0 - 2.0 * i / _OUTLINE_DIRECTIONS, np.pi * (1.0 + 5.0**0.5) * i
    flat = np.sqrt(1.0 - height**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height])


def core_box(bodies: np.ndarray, lows: np.ndarray, highs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds (3,) [m] of the core of samples with bounds (k, 3) [m] of bodies (k,)."""
    each = [bodies == body for body in np.unique(bodies)]
    low = np.quantile([np.quantile(lows[mine], RARE, axis=0) for mine in each], FEW, axis=0, method="higher")
    high = np.quantile([np.quantile(highs[mine], 1 - RARE, axis=0) for mine in each], 1 - FEW, axis=0, method="lower")
    return np.minimum(low, high), np.maximum(low, high)  # two bodies far apart: the core is between them


def in_scene(bodies: np.ndarray, lows: np.ndarray, highs: np.ndarray) -> np.ndarray:
    """(k,) bool: which samples are framed, from their bodies (k,) and bounds (k, 3) [m]; all where none would be."""
    everything = np.ones(len(bodies), dtype=bool)
    if len(np.unique(bodies)) * FEW < 1.0:
        return everything
    low, high = core_box(bodies, lows, highs)
    middles, reach = (lows + highs) / 2, CORE_REACH * (high - low).max()
    near = ((middles >= low - reach) & (middles <= high + reach)).all(axis=1)
    if not near.any() or _longest(lows, highs) <= MOST_ROOM * _longest(lows[near], highs[near]):
        return everything
    return near


def _longest(lows: np.ndarray, highs: np.ndarray) -> float:
    """[m] the longest side of the box around boxes with bounds (k, 3) [m]."""
    return float((highs.max(axis=0) - lows.min(axis=0)).max())


def framed_points(bodies: Sequence[int], samples: Sequence[np.ndarray], obstacles: Iterable[np.ndarray]) -> np.ndarray:
    """The points (n, 3) [m] that a picture frames.

    Parameters
    ----------
    bodies : of each sample its body's number
    samples : at least one; points (k, 3) [m] of a body at a step, enough to frame it
    obstacles : vertices (m, 3) [m] of each obstacle at each step
    """
    lows, highs = np.array([s.min(axis=0) for s in samples]), np.array([s.max(axis=0) for s in samples])
    shown = in_scene(np.asarray(bodies), lows, highs)
    content = [points for points, kept in zip(samples, shown, strict=True) if kept]
    low, high = lows[shown].min(axis=0), highs[shown].max(axis=0)
    diagonal = np.linalg.norm(high - low)
    low, high = low - OBSTACLE_REACH * diagonal, high + OBSTACLE_REACH * diagonal
    for vertices in obstacles:
        least, most = vertices.min(axis=0), vertices.max(axis=0)
        if (most >= low).all() and (least <= high).all():
            whole = np.linalg.norm(most - least) <= LARGEST_WHOLE * diagonal
            content.append(outermost(vertices if whole else np.clip(vertices, low, high)))
    return np.concatenate(content)
