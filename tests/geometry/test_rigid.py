"""Rigid motions of bodies are found exactly, in 2D and 3D, whatever else their points do."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pdvol.geometry.rigid_motions import Pose, angle_between, drift, mass_centres, rigid_motions

RNG = np.random.default_rng(0)


def turn(degrees, d=2, axis=(0, 0, 1)):
    """A rotation: in the plane, or about an axis (3,)."""
    R = Rotation.from_rotvec(np.radians(degrees) * np.array(axis) / np.linalg.norm(axis)).as_matrix()
    return R if d == 3 else Rotation.from_rotvec([0, 0, np.radians(degrees)]).as_matrix()[:2, :2]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("degrees", [0.0, 1e-5, 30.0, 179.0])
def test_known_motions_of_two_bodies_are_found(d, degrees):
    bodies = np.array([0] * 9 + [1] * 7)
    masses = RNG.uniform(0.5, 2.0, 16)
    X = RNG.normal(size=(16, d))
    rotations = [turn(degrees, d, (1, 2, -1)), turn(-degrees, d, (0, 1, 3))]
    shifts = RNG.normal(size=(2, d))
    x = np.array([rotations[b] @ p + shifts[b] for b, p in zip(bodies, X, strict=True)])
    found = rigid_motions(X, x, masses, bodies)
    np.testing.assert_allclose(found.rotations, rotations, atol=3e-9)
    for b in range(2):
        own = bodies == b
        np.testing.assert_allclose(found.centres[b], np.average(x[own], axis=0, weights=masses[own]), atol=1e-14)
    still = np.tile(np.eye(d), (2, 1, 1))
    np.testing.assert_allclose(angle_between(still, found.rotations), degrees, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_the_fit_has_the_least_sum_of_squares_over_the_mass(d):
    """No rotation close to it fits points that were deformed, one of them by a metre, better."""
    masses = RNG.uniform(0.1, 3.0, 12)
    X = RNG.normal(size=(12, d))
    x = X @ turn(50, d, (1, 0, 2)).T + 0.1 * RNG.normal(size=(12, d))
    x[3] += 1.0
    one = np.zeros(12, int)
    found = rigid_motions(X, x, masses, one)
    r, q = X - mass_centres(X, masses, one), x - found.centres
    miss = lambda R: masses @ ((q - r @ R.T) ** 2).sum(axis=1)
    best = miss(found.rotations[0])
    assert best > 0.1
    for axis in np.eye(3)[:: 1 if d == 3 else -3]:
        for degrees in (-0.1, 0.1):
            assert miss(found.rotations[0] @ turn(degrees, d, axis)) > best


@pytest.mark.parametrize("d", [2, 3])
def test_bodies_that_do_not_show_their_turn(d):
    """A point, coincident points and points that have met keep the identity; points of a line turn as it does."""
    line = np.outer(np.linspace(-1, 1, 5), np.eye(d)[0])
    X = np.vstack([np.ones((1, d)), np.zeros((3, d)), RNG.normal(size=(4, d)), line])
    bodies = np.repeat([0, 1, 2, 3], [1, 3, 4, 5])
    R = turn(40, d)
    x = np.vstack([2 * np.ones((1, d)), np.ones((3, d)), np.zeros((4, d)), line @ R.T])
    np.testing.assert_allclose(rigid_motions(X, x, np.ones(13), bodies).rotations, [np.eye(d)] * 3 + [R], atol=1e-8)
    mirrored = rigid_motions(X, X * np.r_[np.ones(d - 1), -1], np.ones(13), bodies)  # gets rotations
    np.testing.assert_allclose(np.linalg.det(mirrored.rotations), 1.0)


def test_angles_in_the_plane_have_no_sign():
    a = np.array([turn(10.0), turn(350.0), turn(0.0)])
    b = np.array([turn(-20.0), turn(10.0), turn(180.0)])
    for one, other in ((a, b), (b, a)):
        np.testing.assert_allclose(angle_between(one, other), [30.0, 20.0, 180.0])


@pytest.mark.parametrize("d", [2, 3])
def test_drift_of_two_bodies_that_are_deformed_alike(d):
    """One is shifted by 5 m, the other one turned about its centre by 20 degrees."""
    bodies, masses = np.repeat([0, 1], 9), RNG.uniform(0.5, 2.0, 18)
    X = RNG.normal(size=(18, d))
    x = X @ (np.eye(d) + 0.1 * RNG.normal(size=(d, d))) + 0.05 * RNG.normal(size=(18, d))
    centre, R = mass_centres(x, masses, bodies)[1], turn(20.0, d, (3, 1, 2))
    other = np.where(bodies[:, None] == 0, x + np.array([3.0, 4.0, 0.0])[:d], centre + (x - centre) @ R.T)
    distances, angles = drift(*(rigid_motions(X, y, masses, bodies) for y in (x, other)))
    np.testing.assert_allclose(distances, [5.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(angles, [0.0, 20.0], atol=1e-6)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("count", [1, 2, 6])
def test_the_rigid_motion_of_points_is_found(d, count):
    """Of two points (a plane's) in 3D, the one that turns least."""
    random, R = np.random.default_rng(3), turn(40.0, d)
    points = random.standard_normal((count, d))
    points[:, 2:] = 0.0 if count == 2 else points[:, 2:]
    shift, others = random.standard_normal(d), random.standard_normal((5, d))
    moved = Pose.fitted(points, points @ R.T + shift)
    np.testing.assert_allclose(moved(points), points @ R.T + shift, atol=1e-8)
    if count > 1:
        np.testing.assert_allclose(moved(others), others @ R.T + shift, atol=1e-7)
    else:
        np.testing.assert_allclose(moved(others) - others, np.tile(moved(points)[0] - points[0], (5, 1)), atol=1e-12)
