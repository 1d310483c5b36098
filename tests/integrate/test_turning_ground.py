"""Bodies on ground that turns, tilts or waits: planes carry them as rigid surfaces do."""

import numpy as np
import pytest

from pdvol.scene import Barrier, Friction, NeoHookean, Rotation, Solver, Translation
from problems import block, ground, make_scene, make_stepper, march, weight

DHAT = 4e-3
SOLVER = Solver(tolerance=1e-5, linear="direct")
STIFF = NeoHookean(young=1e6, poisson=0.3, density=1000.0)


def on_floor(kind, motion, low, high, material=STIFF, velocity=lambda x: 0.0 * x, **more):
    """A stepper of a block between two corners above a floor that moves, and reports of some steps."""
    d, steps = len(low), more.pop("steps")
    floor, geometry = ground(d, kind, motion=motion)
    more = {"dt": 0.02, "loads": (weight(d),), "solver": SOLVER} | more
    contact = (Barrier(dhat=DHAT), Friction(0.8, eps_v=5e-3))
    mesh = block(low, high, 1)
    scene = make_scene((material,), obstacles=(floor,), contact=contact, **more)
    reports = list(march(make_stepper(scene, mesh, geometry), steps, velocity=velocity(mesh.points)))
    return reports, mesh.points.mean(axis=0)


@pytest.mark.parametrize("kind", ["plane", "slab"])
def test_a_turntable_carries_a_block_around(kind):
    """A block one metre from the axis of a table that turns at 1 rad/s (1 m/s^2 to the centre, held by mu g = 7.8)
    stays there, and turns with the table.
    """
    turn, along = Rotation(1.0, (0.0, 0.0, 0.0)), lambda x: np.cross((0.0, 0.0, 1.0), x)
    reports, _ = on_floor(kind, turn, (0.85, -0.15, 0.9 * DHAT), (1.15, 0.15, 0.3), velocity=along, steps=50)
    where = np.array([report.positions.mean(axis=0) for report in reports])
    np.testing.assert_allclose(np.linalg.norm(where[:, :2], axis=1), 1.0, atol=0.01)
    assert np.arctan2(where[-1, 1], where[-1, 0]) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("kind", ["plane", "slab"])
def test_a_board_that_tilts_about_a_point_elsewhere_keeps_its_block(kind):
    """A board turns by 0.3 rad about a point 2 m away, less than the angle of friction: the block goes along."""
    centre, speed = np.array([-2.0, 0.0]), 0.3
    reports, first = on_floor(kind, Rotation(speed, tuple(centre), stop=1.0), (0.0, 0.9 * DHAT), (0.3, 0.3), steps=50)
    c, s = np.cos(speed), np.sin(speed)
    expected = (first - centre) @ np.array([[c, s], [-s, c]]) + centre
    np.testing.assert_allclose(reports[-1].positions.mean(axis=0), expected, atol=0.015)


@pytest.mark.parametrize("kind", ["plane", "slab"])
def test_a_step_rests_after_a_motion_has_ended(kind):
    """A floor that carried a block until 0.1 s: later the block comes to rest, and a step takes one iteration."""
    more = {"material": NeoHookean(1e5, 0.3, 1000.0), "solver": Solver(tolerance=1e-2, linear="direct"), "steps": 40}
    walk = Translation((0.1, 0.0), stop=0.1)
    (*_, last), first = on_floor(kind, walk, (0.0, 0.9 * DHAT), (0.3, 0.2), **more)
    assert last.positions[:, 0].mean() - first[0] == pytest.approx(0.01, abs=2e-3)
    assert last.newton_iterations <= 1


@pytest.mark.parametrize("kind", ["plane", "slab"])
def test_ground_that_rises_into_a_block_carries_it_at_once(kind):
    """The floor turns upwards by several dhat a step. No support is held, so no solve in parts is needed."""
    turn, more = Rotation(2.0, (-1.0, 0.0)), {"dt": 0.01, "loads": (), "steps": 4}
    reports, _ = on_floor(kind, turn, (0.0, 2.0 * DHAT), (0.3, 0.3), **more)
    assert [report.remedies["substeps"] for report in reports] == [0, 0, 0, 0]
    assert all(report.newton_iterations <= 15 and report.cuts == 0 for report in reports)
