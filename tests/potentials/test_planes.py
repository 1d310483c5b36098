"""Half-spaces against formulas written out here: gaps, forces, the largest step; what is found once a state."""

import numpy as np
import pytest
from mpi4py import MPI

import barrier_law
from pdvol.levels.obstacles import plane_obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.contact.barrier import HalfSpaceBarrier
from pdvol.potentials.potential import LastStates, Positions
from pdvol.scene import NeoHookean, Plane, Translation
from problems import elastic
from shapes import box

DHAT, KAPPA, SPEED = 0.3, 7.0, 0.4


def barriers(d):
    """A block beside a slanted plane and above one that rises; the barrier, the space, and positions (n, d)."""
    space = LevelSpace(box(d, 3, jitter=0.1, seed=d), MPI.COMM_SELF)
    up, aside = np.eye(d)[-1], np.eye(d)[0] + 0.1 * np.eye(d)[-1]
    planes = (
        Plane(tuple(-0.2 * up), tuple(up), Translation(tuple(SPEED * up))),
        Plane(tuple(-0.15 * aside), tuple(aside)),
    )
    barrier = HalfSpaceBarrier(space, tuple(map(plane_obstacle, planes)), DHAT, KAPPA)
    return barrier, space, space.from_input(space.mesh.points)


def distances(barrier, x, time):
    """(2, surface vertices) [m]: the first plane has risen, the second one is still."""
    d = x.shape[1]
    up, aside = np.eye(d)[-1], np.eye(d)[0] + 0.1 * np.eye(d)[-1]
    normal = aside / np.linalg.norm(aside)
    on = x[barrier.vertices]
    return np.array([(on + (0.2 - SPEED * time) * up) @ up, (on + 0.15 * aside) @ normal])


@pytest.mark.parametrize("d", [2, 3])
def test_gaps_forces_and_energy(d):
    barrier, space, x = barriers(d)
    at = Positions(space, x)
    for time in (0.0, 0.2):
        barrier.move_obstacles(time)
        gaps = distances(barrier, x, time)
        np.testing.assert_allclose(barrier.gaps(at), gaps, rtol=1e-13, atol=1e-15)
        near = gaps < DHAT
        assert barrier.count(at) == near.sum() > 2 * d
        plane, vertex, force = barrier.forces(at)
        assert set(zip(plane.tolist(), vertex.tolist(), strict=True)) == set(zip(*np.nonzero(near), strict=True))
        s = (gaps[plane, vertex] / DHAT) ** 2
        np.testing.assert_allclose(force, barrier.areas[vertex] * barrier_law.pressure(s, DHAT, KAPPA), rtol=1e-12)
        energy = barrier.areas[vertex] @ barrier_law.energy(s, DHAT, KAPPA)
        np.testing.assert_allclose(barrier.value(at), energy, rtol=1e-12)
        np.testing.assert_allclose(barrier.min_gap(at), gaps.min(), rtol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("until", [None, 0.1])
def test_the_largest_step_keeps_a_share_of_the_gap_that_closes_first(d, until):
    """Gaps are linear in the step, the motion of planes included."""
    barrier, space, x = barriers(d)
    path = -1.5 * np.eye(d)[0] - 0.3 * np.eye(d)[-1] + 0.1 * np.random.default_rng(d).uniform(-1, 1, x.shape)
    step = barrier.max_step(Positions(space, x), path, until, gap_share=0.2)
    before, after = distances(barrier, x, 0.0), distances(barrier, x + path, 0.0 if until is None else until)
    left = ((1.0 - step) * before + step * after) / before
    assert 0.0 < step < 1.0
    np.testing.assert_allclose(left.min(), 0.2, rtol=1e-12)
    assert barrier.max_step(Positions(space, x), -path, until, gap_share=0.2) == 1.0


@pytest.mark.parametrize("d", [2, 3])
def test_what_is_behind_a_plane_has_no_finite_energy_and_no_way_to_go(d):
    barrier, space, x = barriers(d)
    behind = Positions(space, x - 0.25 * np.eye(d)[-1])
    assert barrier.value(behind) == np.inf
    assert barrier.max_step(behind, np.broadcast_to(-np.eye(d)[-1], x.shape).copy()) == 0.0


def test_a_new_stiffness_is_noticed():
    barrier, space, x = barriers(3)
    at = Positions(space, x)
    before = barrier.value(at), barrier.gradient(at)
    barrier.kappa = 3.0 * KAPPA
    np.testing.assert_allclose(barrier.value(at), 3.0 * before[0], rtol=1e-14)
    np.testing.assert_allclose(barrier.gradient(at), 3.0 * before[1], rtol=1e-14)


# ---- what is found once a state


def test_the_last_two_states_are_remembered():
    space = LevelSpace(box(2, 1), MPI.COMM_SELF)
    one, two, three = (Positions(space, space.from_input(space.mesh.points)) for _ in range(3))
    asked: list = []
    find = lambda x: asked.append(x) or float(len(asked))
    states = LastStates()
    assert [states.value(x, find) for x in (one, two, one, two, three, two, one)] == [1.0, 2.0, 1.0, 2.0, 3.0, 2.0, 4.0]
    states.clear()
    assert states.value(one, find) == 5.0


@pytest.mark.parametrize("d", [2, 3])
def test_an_energy_with_new_parameters_is_evaluated_anew(d):
    space = LevelSpace(box(d, 2), MPI.COMM_SELF)
    (term,) = elastic(space, NeoHookean(3.0, 0.3))
    x = Positions(space, space.from_input(space.mesh.points * np.linspace(1.1, 0.9, d)))
    before = term.value(x)
    assert before > 0.0
    term.set_parameters({name: 2.0 * values for name, values in term.parameters.items()})
    np.testing.assert_allclose(term.value(x), 2.0 * before, rtol=1e-14)
