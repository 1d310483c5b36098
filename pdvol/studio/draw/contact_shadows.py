"""Soft contact shadows on a plane: dark and sharp where a body touches it, pale and wide where a body is above it.

The surfaces are projected onto the plane along the light and sorted into bands by their height. Each band is blurred in
proportion to its height, like the half-shadow of a large light. This needs no help of the graphics driver, and shows
how high above the plane a body is.
"""

import numpy as np
from scipy.ndimage import gaussian_filter

# Of each band of heights: its upper bound and its blur, as fractions of the scene's size, and its darkness (1: black).
# Chosen by eye.
_BANDS = ((0.02, 0.007, 0.34), (0.07, 0.018, 0.28), (0.18, 0.04, 0.22), (0.45, 0.08, 0.16), (np.inf, 0.14, 0.10))


def shadow_map(triangles: np.ndarray, size: float, half_width: float, pixels: int) -> np.ndarray:
    """Darkness of a square of the plane.

    Parameters
    ----------
    triangles : (k, 3, 3) float64 [m]
        Corners in the plane's frame: two coordinates along it, already shifted along the light, and the height above
        it.
    size : float [m]
        The scene's size: the unit of bands and blurs.
    half_width : float [m]
        The square reaches from -half_width to half_width.
    pixels : int
        Side of the result.

    Returns
    -------
    (pixels, pixels) float64
        0 is lit, 1 is black; the first index is the second coordinate.
    """
    width = 2 * half_width / pixels
    points = _samples(triangles, width)
    column, row = np.floor((points[:, :2] + half_width) / width).astype(int).T
    seen = (column >= 0) & (column < pixels) & (row >= 0) & (row < pixels)
    height = np.full((pixels, pixels), np.nan)
    np.fmin.at(height, (row[seen], column[seen]), np.maximum(points[seen, 2], 0.0))
    lit = np.ones((pixels, pixels))
    for bound, blur, darkness in _BANDS:
        # Each band includes the lower ones: near the place of contact a body is a little above the plane, and without
        # the lower bands a pale ring would appear.
        band = height <= bound * size
        if band.any():
            lit *= 1.0 - darkness * gaussian_filter(band.astype(float), blur * size / width)
    return 1.0 - lit


def _samples(triangles: np.ndarray, width: float) -> np.ndarray:
    """Points of the triangles, about a pixel apart, shape (n, 3)."""
    edges = np.linalg.norm(triangles[:, :, :2] - np.roll(triangles, 1, axis=1)[:, :, :2], axis=2).max(
        axis=1, initial=0.0
    )
    counts = np.clip(np.ceil(1.3 * edges / width), 1, 256).astype(int)
    counts = 2 ** np.ceil(np.log2(counts)).astype(int)  # few different lattices
    points = []
    for n in np.unique(counts):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        i, j = i[i + j <= n], j[i + j <= n]
        weights = np.column_stack([i, j, n - i - j]) / n
        points.append(np.einsum("pc,tcx->tpx", weights, triangles[counts == n]).reshape(-1, 3))
    return np.concatenate(points) if points else np.zeros((0, 3))
