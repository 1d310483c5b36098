"""How far bodies are apart as a whole: distance of their centres, angle between their orientations."""

import numpy as np

from pdvol.geometry.rigid_motions import RigidMotions, mass_centres, rigid_motions

__all__ = ["RigidMotions", "angle_between", "mass_centres", "rigid_motions"]


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
