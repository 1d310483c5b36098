"""The nearest point of a simplex."""

from itertools import combinations

import numpy as np


def nearest_coordinates(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (n, c) of the point of each simplex, with corners (n, c, d), that is nearest to each of
    points (n, d): none negative, rows sum to one.

    It is the nearest of the projections on the simplex, its facets, edges and corners that lie within these.
    """
    n, count, _ = corners.shape
    best, nearest = np.full(n, np.inf), np.zeros((n, count))
    for size in range(count, 0, -1):
        for chosen in combinations(range(count), size):
            base = corners[:, chosen[0]]
            edges = corners[:, chosen[1:]] - base[:, None]
            sides = np.einsum("nad,nbd->nab", edges, edges)
            right = np.einsum("nad,nd->na", edges, points - base)
            others = np.linalg.solve(sides, right[..., None])[..., 0] if size > 1 else np.zeros((n, 0))
            own = np.column_stack([1.0 - others.sum(axis=1), others])
            place = base + np.einsum("na,nad->nd", others, edges)
            square = ((points - place) ** 2).sum(axis=1)
            closer = (own >= 0.0).all(axis=1) & (square < best)
            best[closer] = square[closer]
            nearest[closer] = 0.0
            nearest[np.ix_(closer, list(chosen))] = own[closer]
    return nearest
