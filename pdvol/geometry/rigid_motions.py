"""Rigid motions: poses, and the rigid motion of each body, whatever its deformation: where its centre of mass is, and
how it is turned (Kabsch 1976).
"""

from dataclasses import dataclass

import numpy as np

LEAST_TURN = 1e-9  # weight of the identity in a fitted rotation: it decides on turns that the points do not show


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


@dataclass(frozen=True, eq=False)
class RigidMotions:
    """Motions x -> c + R (X - C) of b bodies, C the centre of mass of the reference.

    Attributes
    ----------
    centres : (b, d) c, the centres of mass [m]
    rotations : (b, d, d) R, with determinant 1
    """

    centres: np.ndarray
    rotations: np.ndarray


def rigid_motions(reference: np.ndarray, positions: np.ndarray, masses: np.ndarray, bodies: np.ndarray) -> RigidMotions:
    """The motions that take each body from `reference` to `positions` with the least sum of squares over the mass.
    Turns that a body's points do not show, as of a single point or about a line of points, are left out.

    Parameters
    ----------
    reference, positions : (n, d) [m]
    masses : (n,) [kg]
    bodies : (n,) the body of each vertex, 0 ... b - 1; each has a mass
    """
    before, after = (mass_centres(x, masses, bodies) for x in (reference, positions))
    r, q = (reference - before[bodies]).T, masses * (positions - after[bodies]).T
    products = np.stack([np.bincount(bodies, a * b) for a in q for b in r], axis=1)
    return RigidMotions(after, best_rotations(products.reshape(-1, len(q), len(r))))


def mass_centres(positions: np.ndarray, masses: np.ndarray, bodies: np.ndarray) -> np.ndarray:
    """(b, d) [m]: centre of mass of each body; `bodies` (n,) is the body of each vertex."""
    total = np.bincount(bodies, masses)
    return np.column_stack([np.bincount(bodies, masses * x) for x in positions.T]) / total[:, None]


def best_rotations(covariances: np.ndarray) -> np.ndarray:
    """(k, d, d): the rotations R, with determinant 1, that take points r to points q with the least sum of squares,
    from the sums of q r' (k, d, d). Of several it is the one that turns least: the identity where all sums are zero.
    """
    size = np.linalg.norm(covariances, axis=(1, 2), keepdims=True)
    u, _, vt = np.linalg.svd(covariances + LEAST_TURN * size * np.eye(covariances.shape[-1]))
    u[:, :, -1] *= np.sign(np.linalg.det(u @ vt))[:, None]
    return u @ vt


def angle_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(b,) [degrees], 0 to 180: the angle of the rotation that leads from each of (b, d, d) rotations to the other.

    |R - S| = 8^(1/2) |sin(angle / 2)| in Frobenius' norm, in 2D and 3D: exact for small angles, which the trace is not.
    """
    chord = np.linalg.norm(one - other, axis=(1, 2)) / np.sqrt(8.0)
    return np.degrees(2.0 * np.arcsin(np.minimum(chord, 1.0)))


def drift(one: RigidMotions, other: RigidMotions) -> tuple[np.ndarray, np.ndarray]:
    """How far b bodies are from where they are in another motion of the same points: distances of their centres (b,)
    [m], and angles between their orientations (b,) [degrees].
    """
    return np.linalg.norm(one.centres - other.centres, axis=1), angle_between(one.rotations, other.rotations)
