"""Vertices and edges within flat parts of a surface, which cannot be the first that something touches.

What meets a flat part first is a vertex of the other side, or the part's outline: an edge that comes down on the part
and crosses an edge within it touches the part on a length, and that ends at the other edge's end or at the outline. So
contacts of such vertices and edges keep nothing apart. Where the surface is rigid they do harm. How many there are, and
how near, depends on how the part is cut into facets, so they would push along it.
"""

import numpy as np

# sine of the angle between facets of one flat part: round-off of coordinates that were turned and shifted
FLAT_SINE = 1e-10


def flat_parts(
    vertices: np.ndarray, facets: np.ndarray, edges: np.ndarray, facet_edges: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Masks of vertices (n,) with nothing but one flat part around them, and of edges (e,) between two facets of it.

    Parameters
    ----------
    vertices : (n, d)
    facets : (f, d) int
    edges : (e, 2) int
        None in 2D, where facets are edges.
    facet_edges : (f, 3) int
        Of the sides of each facet, from its corners 0, 1, 2 on; in 3D alone.
    """
    n, d = vertices.shape
    if d == 2:
        two, first, second = _pairs(facets.ravel(), n)
        along = (vertices[facets[:, 1]] - vertices[facets[:, 0]]).repeat(2, axis=0)
        along[::2] *= -1.0  # towards the vertex
        return _same_direction(two, along[first], -along[second], n), np.zeros(0, dtype=bool)
    two, first, second = _pairs(facet_edges.ravel(), len(edges))
    apexes = vertices[facets[:, [2, 0, 1]].ravel()]
    start, end = vertices[edges[two]].swapaxes(0, 1)
    flat = _same_direction(
        two, np.cross(end - start, apexes[first] - start), np.cross(apexes[second] - start, end - start), len(edges)
    )
    inside = np.bincount(facets.ravel(), minlength=n) > 0
    inside[edges[~flat]] = False
    return inside, flat


def _pairs(of: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The numbers below `count` that occur twice in `of` (k,), and where they are."""
    order = np.argsort(of, kind="stable")
    starts = np.searchsorted(of[order], np.arange(count + 1))
    two = np.flatnonzero(np.diff(starts) == 2)
    return two, order[starts[two]], order[starts[two] + 1]


def _same_direction(chosen: np.ndarray, one: np.ndarray, other: np.ndarray, count: int) -> np.ndarray:
    """Mask (count,) of those chosen for which two vectors have the same direction."""
    sizes = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    turned = np.cross(one, other) if one.shape[1] == 3 else one[:, :1] * other[:, 1:] - one[:, 1:] * other[:, :1]
    mask = np.zeros(count, dtype=bool)
    mask[chosen] = (np.linalg.norm(turned, axis=1) <= FLAT_SINE * sizes) & (np.einsum("ki,ki->k", one, other) > 0.0)
    return mask
