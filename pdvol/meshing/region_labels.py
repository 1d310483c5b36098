"""Carries region labels from an input's cells to those of a mesh built from its boundary."""

import numpy as np
from scipy.spatial import cKDTree

from pdvol.meshes import Solid


def no_regions(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Label 0 for every cell."""
    return np.zeros(len(cells), dtype=np.int32)


class Regions:
    """The region of the input cell that contains a new cell's centroid; of the nearest by centroid where none of the
    near ones does.
    """

    NEARBY_CELLS = 32  # input cells tried per new cell: those whose centroids are nearest

    def __init__(self, solid: Solid):
        self.solid = solid
        corners = solid.vertices[solid.cells]
        self.tree = cKDTree(corners.mean(axis=1))
        self.origins = corners[:, 0]
        self.inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))

    def __call__(self, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
        if (self.solid.regions == self.solid.regions[0]).all():
            return np.full(len(cells), self.solid.regions[0], dtype=np.int32)
        centroids = points[cells].mean(axis=1)
        near = self.tree.query(centroids, k=min(self.NEARBY_CELLS, len(self.solid.cells)))[1].reshape(len(cells), -1)
        inner = np.einsum("ckij,ckj->cki", self.inverse[near], centroids[:, None] - self.origins[near])
        # How far outside each near cell the centroid is; the first of the containing ones, else the nearest.
        outside = np.maximum(-inner.min(axis=2), inner.sum(axis=2) - 1.0)
        inside = outside <= 1e-9
        pick = np.where(inside.any(axis=1), inside.argmax(axis=1), 0)
        return self.solid.regions[near[np.arange(len(cells)), pick]].astype(np.int32)
