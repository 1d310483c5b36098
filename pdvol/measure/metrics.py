"""Measures of stored motion (paper, appendix C, and four more). Arrays in, numbers out; forces come from elsewhere
(`pdvol.runs.run_metrics`).

| measure | formula | unit |
|---|---|---|
| continuity n_l^t | e / e_hat, e = \\|(x+ - x_own) / 2 + pull / 2\\|_M^2, e_hat = \\|x+ - x_hat + pull\\|_M^2 | 1 |
| continuity error e_l^t | the numerator alone times (dt^2 / w)^2, which needs no x_hat | kg m^2 |
| consistency d_{l-1}^t | \\|Pi x_l - x_{l-1}\\|_M^2, Pi = (P'P)^-1 P', M of level l - 1 | kg m^2 |
| distance | root of \\|x_l - P x_{l-1}\\|_M^2 over the mass, M of level l | m |
| drift | of a body's centre and turn in x_l from those in P x_{l-1}, or in P ... P x_0 | m, degrees |
| centre error | how far two runs' bodies have moved apart since the start, root mean square over the mass | m |
| roughness | root of \\|x-- - 4 x- + 6 x - 4 x+ + x++\\|_M^2 over the mass: what changes from step to step | m |
| jitter | 1/2 \\|v+ - v\\|_M^2, v the mean velocity over a step: gravity alone gives 1/2 m g^2 dt^2 | J |

x--, x-, x, x+, x++ are the positions at t - 2 dt, t - dt, t, t + dt and t + 2 dt, M the lumped mass, w the step's
weight, pull = w M^-1 grad F(x+). x_own is what the integrator predicts from the level's own states, 2 x - x- with
implicit Euler, and x_hat what the step was solved with. So n is 1/4 for direct levels by any integrator, whatever the
residual that the solver leaves, and e of the same accelerations is the same for all of them.
"""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

OTHER_PLACE = 0.25  # of the body's size: a body that ends further away lies in another place
ROUGHER = 1.3  # times level 0's roughness: levels whose motion is as smooth scatter by less
OTHER_FACE = 30.0  # degrees: a body that is turned further about its own axes lies on another face
RANK_TOLERANCE = 1e-5  # of P's norm: smaller singular values count as zero


def squared_norm(difference: np.ndarray, masses: np.ndarray) -> float:
    """|u|_M^2 [kg m^2] of vertex vectors (n, d) [m]."""
    return float(masses @ (difference**2).sum(axis=1))


def continuity_error(own: np.ndarray, after: np.ndarray, pull: np.ndarray, masses: np.ndarray) -> float:
    """e [kg m^2] without its factor: how far a step to `after` is from the motion that the forces F alone would give;
    arguments as `continuity`'s.
    """
    return squared_norm(0.5 * (after - own) + 0.5 * pull, masses)


def continuity(
    own: np.ndarray,
    predicted: np.ndarray,
    after: np.ndarray,
    pull: np.ndarray,
    masses: np.ndarray,
    guided: np.ndarray | float = 0.0,
) -> float:
    """n of a step to `after`; NaN where the solver left no residual at all.

    Parameters
    ----------
    own, predicted, after : (n, d) [m]
        The prediction from the level's own states, x_hat of the step, and the positions at its end.
    pull : (n, d) [m]
        w M^-1 grad F(after).
    masses : (n,) [kg]
        Zero at supported vertices, whose reaction forces are unknown.
    guided : (n, d) [m]
        What the pull towards a coarser level adds: it belongs to what was solved, so to e_hat, but is no force of the
        scene, so not to e.
    """
    residual = squared_norm(after - predicted + pull + guided, masses)
    return continuity_error(own, after, pull, masses) / residual if residual > 0 else float("nan")


def distance(fine: np.ndarray, prolonged: np.ndarray, masses: np.ndarray) -> float:
    """Root mean square distance [m] of two configurations (n, d) of one level."""
    return float(np.sqrt(squared_norm(fine - prolonged, masses) / masses.sum()))


def root_mean_square(values: Sequence[float]) -> float:
    """Zero where there are none."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def elsewhere(centres: np.ndarray, angles: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """(b,) bool: which bodies lie in another place or on another face than where `drift` was measured from; distances
    of their centres [m], angles [degrees] and sizes [m] are (b,).
    """
    return (centres > OTHER_PLACE * sizes) | (angles > OTHER_FACE)


def roughness(states: Sequence[np.ndarray], masses: np.ndarray) -> float:
    """Root mean square over the mass of the fourth difference in time [m] of five configurations (n, d)."""
    return distance(np.diff(np.array(states), 4, axis=0)[0], np.zeros(1), masses)


def jitter(before: np.ndarray, now: np.ndarray, after: np.ndarray, dt: float, masses: np.ndarray) -> float:
    """Energy of the second difference in time [J]."""
    return 0.5 * squared_norm(after - 2.0 * now + before, masses) / dt**2


def centre_error(moved: np.ndarray, other: np.ndarray, body_masses: np.ndarray) -> float:
    """Root mean square [m], over the mass, of the distance between two displacements of centres (bodies, d) [m]."""
    return float(np.sqrt(body_masses @ ((moved - other) ** 2).sum(axis=1) / body_masses.sum()))


class Projection:
    """Pi = (P'P)^-1 P', the least-squares way back from a fine level to a coarse one.

    P'P is singular where the fine positions do not determine the coarse ones, above all at a coarse vertex that binds
    no fine one. There the coarse level's own positions are kept and add nothing to the measure: `difference` is the
    smallest y that minimises |P (x_c + y) - x_f|.

    Attributes
    ----------
    columns : int
        Coarse vertices.
    rank : int
        Of P, where singular values below `RANK_TOLERANCE` times a bound of its norm count as zero.
    """

    def __init__(self, weights: sp.csr_matrix):
        self.weights = weights
        normal = (weights.T @ weights).tocsc()
        # The largest row sum bounds the largest eigenvalue.
        floor = RANK_TOLERANCE**2 * float(abs(normal).sum(axis=1).max()) * sp.eye(normal.shape[0], format="csc")
        self.columns = weights.shape[1]
        self.rank = self.columns - negative_eigenvalues(normal - floor)
        self._solve = splu(normal + floor).solve

    def difference(self, fine: np.ndarray, coarse: np.ndarray) -> np.ndarray:
        """Pi x_f - x_c, shape (n_coarse, d) [m]."""
        return self._solve(self.weights.T @ (fine - self.weights @ coarse))


def negative_eigenvalues(matrix: sp.csc_matrix) -> int:
    """The number of negative eigenvalues of a symmetric matrix, by pivots of its LDL' (Sylvester's law of inertia)."""
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    if np.array_equal(factors.perm_r, factors.perm_c):
        return int(np.sum(factors.U.diagonal() < 0))
    return int(np.sum(np.linalg.eigvalsh(matrix.toarray()) < 0))  # a zero on the diagonal made it pivot otherwise
