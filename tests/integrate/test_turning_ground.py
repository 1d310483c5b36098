"""Bodies on ground that turns, tilts or waits: planes carry them as rigid surfaces do."""

import numpy as np
import pytest

from pdvol.scene import Barrier, Friction, Gravity, NeoHookean, Plane, Rigid, Rotation, Solver, Translation
from problems import block, make_scene, make_stepper, march, polyline

DHAT = 4e-3
SOLVER = Solver(tolerance=1e-5, linear="direct")
STIFF = NeoHookean(young=1e6, poisson=0.3, density=1000.0)


def ground(d, kind, motion, height):
    """A floor at a height [m], as a plane or as a slab, and the slab's geometry."""
    if kind == "plane":
        return Plane((0.0,) * (d - 1) + (height,), tuple(np.eye(d)[-1]), motion, name="floor"), ()
    if d == 2:
        shape = polyline([(-3.0, height - 1.0), (3.0, height - 1.0), (3.0, height), (-3.0, height)])
    else:
        corners = np.array([(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)])
        points = np.array([(*c, h) for h in (height - 1.0, height) for c in corners])
        sides = [[i, (i + 1) % 4, (i + 1) % 4 + 4] for i in range(4)] + [[i, (i + 1) % 4 + 4, i + 4] for i in range(4)]
        faces = np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], *sides])
        edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
        shape = points, edges, faces
    return Rigid("floor", motion=motion, name="floor"), (shape,)


def centres(scene, mesh, geometry, steps, start=None):
    """(steps + 1, d) [m]: the mean position at first and after each step, and the last report."""
    velocity = None if start is None else start(mesh.points)
    reports = list(march(make_stepper(scene, mesh, geometry), steps, velocity=velocity))
    return np.array([x.mean(axis=0) for x in (mesh.points, *(report.positions for report in reports))]), reports[-1]


@pytest.mark.parametrize("kind", ["plane", "slab"])
def test_a_turntable_carries_a_block_around(kind):
    """A block one metre from the axis of a table that turns at 1 rad/s (1 m/s^2 to the centre, held by mu g = 7.8)
    stays there, and turns with the table.
    """
    floor, geometry = ground(3, kind, Rotation(1.0, (0.0, 0.0, 0.0)), 0.0)
    scene = make_scene(
        (STIFF,),
        dt=0.02,
        loads=(Gravity((0.0, 0.0, -9.81)),),
        obstacles=(floor,),
        contact=(Barrier(dhat=DHAT), Friction(0.8, eps_v=5e-3)),
        solver=SOLVER,
    )
    mesh = block((0.85, -0.15, 0.9 * DHAT), (1.15, 0.15, 0.3), 1)
    along = lambda x: np.cross((0.0, 0.0, 1.0), x)
    where, _ = centres(scene, mesh, geometry, 50, along)
    np.testing.assert_allclose(np.linalg.norm(where[:, :2], axis=1), 1.0, atol=0.01)
    assert np.arctan2(where[-1, 1], where[-1, 0]) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("kind", ["plane", "slab"])
def test_a_board_that_tilts_about_a_point_elsewhere_keeps_its_block(kind):
    """A board turns by 0.3 rad about a point 2 m away, less than the angle of friction: the block goes along."""
    centre, speed, steps = np.array([-2.0, 0.0]), 0.3, 50
    floor, geometry = ground(2, kind, Rotation(speed, tuple(centre), stop=1.0), 0.0)
    scene = make_scene(
        (STIFF,),
        dt=0.02,
        loads=(Gravity((0.0, -9.81)),),
        obstacles=(floor,),
        contact=(Barrier(dhat=DHAT), Friction(0.8, eps_v=5e-3)),
        solver=SOLVER,
    )
    mesh = block((0.0, 0.9 * DHAT), (0.3, 0.3), 1)
    where, _ = centres(scene, mesh, geometry, steps)
    c, s = np.cos(speed), np.sin(speed)
    expected = (where[0] - centre) @ np.array([[c, s], [-s, c]]) + centre
    np.testing.assert_allclose(where[-1], expected, atol=0.015)


@pytest.mark.parametrize("kind", ["plane", "slab"])
def test_a_step_rests_after_a_motion_has_ended(kind):
    """A floor that carried a block until 0.1 s: later the block comes to rest, and a step takes one iteration."""
    floor, geometry = ground(2, kind, Translation((0.1, 0.0), stop=0.1), 0.0)
    scene = make_scene(
        (NeoHookean(young=1e5, poisson=0.3, density=1000.0),),
        dt=0.02,
        loads=(Gravity((0.0, -9.81)),),
        obstacles=(floor,),
        contact=(Barrier(dhat=DHAT), Friction(0.8, eps_v=5e-3)),
        solver=Solver(tolerance=1e-2, linear="direct"),
    )
    mesh = block((0.0, 0.9 * DHAT), (0.3, 0.2), 1)
    where, last = centres(scene, mesh, geometry, 40)
    assert where[-1, 0] - where[0, 0] == pytest.approx(0.01, abs=2e-3)
    assert last.newton_iterations <= 1


@pytest.mark.parametrize("kind", ["plane", "slab"])
def test_ground_that_rises_into_a_block_carries_it_at_once(kind):
    """The floor turns upwards by several dhat a step. No support is held, so no solve in parts is needed."""
    floor, geometry = ground(2, kind, Rotation(2.0, (-1.0, 0.0)), 0.0)
    scene = make_scene(
        (STIFF,), dt=0.01, obstacles=(floor,), contact=(Barrier(dhat=DHAT), Friction(0.5, eps_v=5e-3)), solver=SOLVER
    )
    mesh = block((0.0, 2.0 * DHAT), (0.3, 0.3), 1)
    reports = list(march(make_stepper(scene, mesh, geometry), 4))
    assert [report.remedies["substeps"] for report in reports] == [0, 0, 0, 0]
    assert all(report.newton_iterations <= 15 and report.cuts == 0 for report in reports)
