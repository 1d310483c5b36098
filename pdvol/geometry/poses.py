"""Rigid poses: where a motion that keeps shapes takes points from rest."""

from dataclasses import dataclass

import numpy as np

from pdvol.geometry.rigid_motions import best_rotations


@dataclass(frozen=True, eq=False)
class Pose:
    """The rigid map X -> R X + c.

    Attributes
    ----------
    rotation : (d, d) R, with determinant 1
    shift : (d,) c [m]
    """

    rotation: np.ndarray
    shift: np.ndarray

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """(n, d) [m]: where it takes points (n, d)."""
        return points @ self.rotation.T + self.shift

    def __matmul__(self, first: "Pose") -> "Pose":
        """The pose that applies another one first."""
        return Pose(self.rotation @ first.rotation, self.rotation @ first.shift + self.shift)

    @property
    def inverse(self) -> "Pose":
        """The pose that leads back."""
        return Pose(self.rotation.T, -self.rotation.T @ self.shift)

    @classmethod
    def fitted(cls, before: np.ndarray, after: np.ndarray) -> "Pose":
        """The pose that takes points (k, d) to where they are `after`, as nearly as one can (Kabsch 1976). Of several
        it is the one that turns least.
        """
        start, end = before.mean(axis=0), after.mean(axis=0)
        (turn,) = best_rotations(((after - end).T @ (before - start))[None])
        return cls(turn, end - turn @ start)

    @classmethod
    def of_frame(cls, before: np.ndarray, after: np.ndarray) -> "Pose":
        """The pose of a frame: an origin and d points around it, one on each axis, (d + 1, d) [m] before and after. It
        takes origin to origin, and axes to the nearest orthonormal ones.
        """
        axes, turned = (before[1:] - before[0]).T, (after[1:] - after[0]).T
        u, _, vt = np.linalg.svd(turned @ np.linalg.inv(axes))
        u[:, -1] *= np.linalg.det(u @ vt)
        turn = u @ vt
        return cls(turn, after[0] - turn @ before[0])
