"""Half-spaces against formulas written out here: gaps, forces and the largest step."""

import numpy as np
import pytest
from mpi4py import MPI

import barrier_law
from pdvol.geometry.level_mesh import boundary_areas
from pdvol.levels.obstacles import plane_obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.candidates import Candidates
from pdvol.potentials.contact.surface import ContactSurface
from pdvol.potentials.potential import Positions
from pdvol.scene import Plane, Translation
from shapes import level

DHAT, KAPPA, SPEED = 0.3, 7.0, 0.4


def barriers(d):
    """A triangle or tetrahedron, too large to touch itself, beside a slanted plane and above one that rises; the
    barrier, the space, and positions (n, d).
    """
    corners = 0.5 * np.ones(d) + np.vstack([np.zeros(d), 2.0 * np.eye(d)]) - 0.05 * np.arange(d + 1)[:, None]
    space = LevelSpace(level(corners - 0.5, [range(d + 1)]), MPI.COMM_SELF)
    up, aside = np.eye(d)[-1], np.eye(d)[0] + 0.1 * np.eye(d)[-1]
    planes = (
        Plane(tuple(-0.2 * up), tuple(up), Translation(tuple(SPEED * up))),
        Plane(tuple(-0.25 * aside), tuple(aside)),
    )
    surface = ContactSurface(space, tuple(map(plane_obstacle, planes)))
    return ContactBarrier(Candidates(surface, DHAT), KAPPA), space, space.from_input(space.mesh.points)


def distances(x, time):
    """(2, n) [m]: the first plane has risen, the second one is still."""
    d = x.shape[1]
    up, aside = np.eye(d)[-1], np.eye(d)[0] + 0.1 * np.eye(d)[-1]
    normal = aside / np.linalg.norm(aside)
    return np.array([(x + (0.2 - SPEED * time) * up) @ up, (x + 0.25 * aside) @ normal])


@pytest.mark.parametrize("d", [2, 3])
def test_gaps_forces_and_energy(d):
    barrier, space, x = barriers(d)
    at = Positions(space, x)
    areas = boundary_areas(space.mesh)[space.owned_points]
    for time in (0.0, 0.2):
        barrier.move_obstacles(time)
        gaps = distances(x, time)
        near, found = gaps < DHAT, barrier.contacts(at)
        assert barrier.count(at) == near.sum() == found.half_spaces == len(found) > d
        bodies, planes = found.objects_in_contact(barrier.surface.objects)
        rows = barrier.surface.rows[found.vertices[:, 0]]
        assert set(zip(planes - 1, rows, strict=True)) == set(zip(*np.nonzero(near), strict=True))
        assert np.all(bodies == 0)
        gap = gaps[planes - 1, rows]
        np.testing.assert_allclose(np.linalg.norm(found.gaps, axis=1), gap, rtol=1e-13, atol=1e-15)
        np.testing.assert_allclose(found.gaps_of(barrier.surface.vertices(at)), found.gaps, atol=1e-14)
        np.testing.assert_allclose(found.pressures, barrier_law.pressure((gap / DHAT) ** 2, DHAT, KAPPA), rtol=1e-12)
        np.testing.assert_allclose(found.weights, areas[rows], rtol=1e-14)
        energy = areas[rows] @ barrier_law.energy((gap / DHAT) ** 2, DHAT, KAPPA)
        np.testing.assert_allclose(barrier.value(at), energy, rtol=1e-12)
        np.testing.assert_allclose(barrier.min_gap(at), gaps.min(), rtol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("until", [None, 0.1])
def test_the_largest_step_keeps_a_share_of_the_gap_that_closes_first(d, until):
    """Gaps are linear in the step, the motion of planes included."""
    barrier, space, x = barriers(d)
    path = -1.5 * np.eye(d)[0] - 0.3 * np.eye(d)[-1] + 0.1 * np.random.default_rng(d).uniform(-1, 1, x.shape)
    step = barrier.max_step(Positions(space, x), path, until, gap_share=0.2)
    before, after = distances(x, 0.0), distances(x + path, 0.0 if until is None else until)
    left = ((1.0 - step) * before + step * after) / before
    assert 0.0 < step < 1.0
    np.testing.assert_allclose(left.min(), 0.2, rtol=1e-12)
    assert barrier.max_step(Positions(space, x), -path, until, gap_share=0.2) == 1.0


@pytest.mark.parametrize("d", [2, 3])
def test_what_is_behind_a_plane_has_no_finite_energy_and_no_way_to_go(d):
    barrier, space, x = barriers(d)
    behind = Positions(space, x - 0.25 * np.eye(d)[-1])
    assert barrier.value(behind) == np.inf and barrier.behind_planes(behind) == np.sum(distances(behind.owned, 0.0) < 0)
    assert barrier.behind_planes(behind) > 1 and barrier.behind_planes(Positions(space, x)) == 0
    assert barrier.max_step(behind, np.broadcast_to(-np.eye(d)[-1], x.shape).copy()) == 0.0
