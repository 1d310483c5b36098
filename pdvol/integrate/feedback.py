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
from pdvol.levels.prolongation import Prolongation


class Feedback:
    """The push of each step. Not collective, but for `coarse_positions`: every rank computes all of it.

    Parameters
    ----------
    model : LevelModel
    prolongation : from the level below
    masses : (n,) [kg]
        Their ratios are all that counts.
    coarse_positions : step t -> x_c^t (n_coarse, d) [m]
    """

    def __init__(
        self,
        model: LevelModel,
        prolongation: Prolongation,
        masses: np.ndarray,
        coarse_positions: Callable[[int], np.ndarray],
    ):
        self._model, self._prolongation, self._masses = model, prolongation, masses
        self._coarse_positions = coarse_positions

    def push(self, step: int, positions: np.ndarray) -> np.ndarray:
        """(n, d) [m]: what the step that begins at `positions` (n, d), after so many steps, adds to x_hat."""
        model, bodies = self._model, self._model.mesh.point_bodies
        below = self._prolongation.prolong(self._coarse_positions(step))
        held = np.zeros(len(positions), dtype=bool)
        for support in model.supports:
            if support.holds(step * model.dt, model.dt):
                held |= support.mask
        push = _rigid_share(model.feedback, positions, below, self._masses, bodies)
        push[np.bincount(bodies, held)[bodies] > 0] = 0.0
        return push


def level_feedback(
    model: LevelModel, hierarchy: Hierarchy, method: str, coarse_positions: Callable[[int], np.ndarray]
) -> tuple[Feedback, ...]:
    """The feedback of a level in a run by a method: of progressive ones above level 0, where the scene has any."""
    if method != "progressive" or model.level == 0 or model.feedback == 0.0:
        return ()
    masses = lumped_masses(model.mesh, model.materials.density)
    return (Feedback(model, hierarchy.prolongation(model.level), masses, coarse_positions),)


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
