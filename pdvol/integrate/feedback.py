"""Drift feedback of a progressive level: what has gained a distance from the level below returns by a share of it in
each step.

VelPro takes velocities from the level below, no positions, so distances that impacts leave would stay. With a share
beta the prediction is

    x_hat = x^t + P (x_hat_c - x_c^t) + push,    push = the rigid part of beta (P x_c^t - x^t).

The push is taken body by body from the rigid motion that leads x^t nearest to P x_c^t over the mass: beta of its
centre's way, and a turn about its axis by the angle of (1 - beta) + beta exp(i a), which is beta a where a is small. So
it deforms nothing, and beta = 1 makes up for all of a rigid distance. Bodies that a support holds get none.

In free motion a distance shrinks by 1 - beta a step, whatever dt. Where contact holds it, the push is a constant force
beta over the step's weight times mass and distance. `docs/methods.md` derives both.
"""

from collections.abc import Callable

import numpy as np

from pdvol.geometry.level_mesh import lumped_masses
from pdvol.geometry.rigid_motions import best_rotations, mass_centres, rigid_motions
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import LevelModel

Push = Callable[[int, np.ndarray], np.ndarray]
"""What the step that begins at positions (n, d) [m], after so many steps, adds to x_hat: (n, d) [m]."""


def level_feedback(
    model: LevelModel, hierarchy: Hierarchy, method: str, coarse_positions: Callable[[int], np.ndarray]
) -> tuple[Push, ...]:
    """The feedback of a level in a run by a method: of progressive ones above level 0, where the scene has any. It
    depends on the ratios of masses alone. A push is not collective, but for `coarse_positions`: every rank computes all
    of it.

    Parameters
    ----------
    coarse_positions : step t -> x_c^t (n_coarse, d) [m]
    """
    if method != "progressive" or model.level == 0 or model.feedback == 0.0:
        return ()
    masses, bodies = lumped_masses(model.mesh, model.materials.density), model.mesh.point_bodies
    prolongation = hierarchy.prolongation(model.level)

    def push(step: int, positions: np.ndarray) -> np.ndarray:
        below = prolongation.prolong(coarse_positions(step))
        held = np.zeros(len(positions), dtype=bool)
        for support in model.supports:
            if support.holds(step * model.dt, model.dt):
                held |= support.mask
        pushed = _rigid_share(model.feedback, positions, below, masses, bodies)
        pushed[np.bincount(bodies, held)[bodies] > 0] = 0.0
        return pushed

    return (push,)


def _rigid_share(
    share: float, positions: np.ndarray, goal: np.ndarray, masses: np.ndarray, bodies: np.ndarray
) -> np.ndarray:
    """(n, d) [m]: a share of the rigid motion of each body that comes nearest to its goal (n, d): of the centre's way,
    and a turn about the same axis.
    """
    motions, centres = rigid_motions(positions, goal, masses, bodies), mass_centres(positions, masses, bodies)
    turns = best_rotations((1.0 - share) * np.eye(positions.shape[1]) + share * motions.rotations)
    ways = share * (motions.centres - centres)
    arms = positions - centres[bodies]
    return ways[bodies] + np.einsum("nij,nj->ni", turns[bodies], arms) - arms
