"""Closest points of points, segments and triangles, for many pairs at once."""

import numpy as np

# Lower bound of the squared sine of the angle between lines, in the determinant: avoids 0 / 0 where they are parallel.
PARALLEL_TOLERANCE = 1e-12


def along(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Where the foot of p (k, d) lies between a (0) and b (1), cut off at the ends."""
    edge = b - a
    return np.clip(_dot(p - a, edge) / np.maximum(_dot(edge, edge), 1e-300), 0.0, 1.0)


def inside(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Coordinates (k, 2) of the foot of p in triangles (k, 3, d), along their first vertex's two edges."""
    e, f, r = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], p - corners[:, 0]
    ee, ef, ff, re, rf = _dot(e, e), _dot(e, f), _dot(f, f), _dot(r, e), _dot(r, f)
    determinant = np.maximum(ee * ff - ef**2, 1e-300)
    return np.column_stack([(ff * re - ef * rf) / determinant, (ee * rf - ef * re) / determinant])


def closest(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Closest points of the lines through segments ab and cd, as shares (k,) along each."""
    e, f, r = b - a, d - c, a - c
    ee, ef, ff, er, fr = _dot(e, e), _dot(e, f), _dot(f, f), _dot(e, r), _dot(f, r)
    determinant = np.maximum(ee * ff - ef**2, PARALLEL_TOLERANCE * ee * ff + 1e-300)
    return (ef * fr - ff * er) / determinant, (ee * fr - ef * er) / determinant


def closest_of_parts(
    a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray, kind: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Closest points of segments ab and cd, as shares (k,) along each, where one of them at least is an end: which,
    says ipctk's distance type (below 8).
    """
    zero, one = np.zeros(len(a)), np.ones(len(a))
    shares = [
        (zero, zero),
        (zero, one),
        (one, zero),
        (one, one),
        (along(c, a, b), zero),
        (along(d, a, b), one),
        (zero, along(a, c, d)),
        (one, along(b, c, d)),
    ]
    pick = np.arange(len(a))
    return np.array([s for s, _ in shares])[kind, pick], np.array([t for _, t in shares])[kind, pick]


def segment_distances(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Distances (k,) of segments ab and cd, too large by no more than 1e-6 of ab's length: as much as that is where
    they are nearly parallel.

    The lines' closest point on ab, if it lies on the segment, its foot on cd, and that one's foot on ab (Ericson 2005,
    section 5.1.9).
    """
    s = np.clip(closest(a, b, c, d)[0], 0.0, 1.0)[:, None]
    t = along(a + s * (b - a), c, d)[:, None]
    foot = c + t * (d - c)
    s = along(foot, a, b)[:, None]
    apart = a + s * (b - a) - foot
    return np.sqrt(_dot(apart, apart))


def _dot(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.einsum("kd,kd->k", x, y)
