"""The same scene from other frames: the whole world turned, or seen from something that moves evenly."""

import numpy as np
import pytest

from pdvol.levels.obstacles import ground_of, plane_obstacle
from pdvol.levels.script import Script
from pdvol.scene import (
    Barrier,
    Friction,
    Gravity,
    Plane,
    Rigid,
    Rotation,
    Sequential,
    Solver,
    Support,
    Translation,
    rotation_matrix,
)
from pdvol.scene import Path as Keys
from problems import SOFT, block, make_scene, make_stepper, march, polyline, tetrahedron
from shapes import level, together

DHAT, DT, STEPS = 5e-3, 0.01, 24
AXIS = (0.3, -0.5, 1.0)


def world(d, angle, drift):
    """Positions of all steps, taken back to the first frame. A block slides on a floor that turns about a point far
    away and ends to move meanwhile, and is pushed by a ram; another block hangs from a support that follows a path.

    Parameters
    ----------
    angle : [rad] by which the world is turned about the origin
    drift : (d,) velocity [m/s] added to everything
    """
    R = rotation_matrix(angle, AXIS, d)
    seen = lambda motion: Sequential((motion, Translation(tuple(drift))))
    turned = lambda *v: tuple(R @ np.array(v[:d] if d == 2 else v))
    up = (0.0, 1.0) if d == 2 else (0.0, 0.0, 1.0)
    flat = (0.0,) * (d - 2)
    first = block((0.0, *flat, 0.6 * DHAT), (0.2, *(0.2,) * (d - 2), 0.2), 2)
    second = block((1.0, *flat, 0.5), (1.2, *(0.2,) * (d - 2), 0.7), 1)
    mesh = together(first, second)
    mesh = level(mesh.points @ R.T, mesh.cells, mesh.bodies)
    if d == 2:
        ram = polyline([(-0.3, 0.05), (-0.02, 0.02), (-0.02, 0.15)])
    else:
        ram = tetrahedron([(-0.02, 0.1, 0.1), (-0.4, -0.2, 0.05), (-0.4, 0.4, 0.05), (-0.4, 0.1, 0.4)])
    ram = (ram[0] @ R.T, *ram[1:])
    floor = Rotation(0.4, turned(-3.0, -1.0, 0.5), turned(0.2, -1.0, 0.3) if d == 3 else (0.0, 0.0, 1.0), stop=0.12)
    swing = Keys((0.0, 0.1, 0.3), [turned(0.0, *flat, 0.0), turned(0.05, *flat, 0.02), turned(-0.05, *flat, 0.0)])
    scene = make_scene(
        (SOFT, SOFT),
        dt=DT,
        loads=(Gravity(tuple(-9.81 * (R @ np.array(up)))),),
        supports=(Support(lambda X: (X @ R)[:, -1] > 0.69, body="body 1", motion=seen(swing)),),
        obstacles=(
            Plane((0.0,) * d, tuple(R @ np.array(up)), seen(floor), name="floor"),
            Rigid("ram", motion=seen(Translation(turned(0.5, *flat, 0.0), stop=0.15)), name="ram"),
        ),
        contact=(Barrier(dhat=DHAT), Friction(0.5, eps_v=5e-3)),
        solver=Solver(tolerance=1e-8, linear="direct"),
    )
    reports = list(march(make_stepper(scene, mesh, [ram]), STEPS, velocity=np.zeros_like(mesh.points) + drift))
    assert all(report.behind == 0.0 for report in reports)
    return np.array([(report.positions - report.time * np.asarray(drift)) @ R for report in reports])


@pytest.mark.parametrize("d", [2, 3])
def test_the_motion_is_the_same(d):
    """In a world that is turned and drifts. The block has been pushed and carried, or the frames would agree for
    nothing.
    """
    alone = world(d, 0.0, np.zeros(d))
    assert np.linalg.norm(alone[-1] - alone[0], axis=1).min() > 0.02
    np.testing.assert_allclose(world(d, 0.9, np.array([0.5, -0.3, 0.2][:d])), alone, rtol=0.0, atol=1e-6)


def pressed(d, pusher, angle, drift):
    """A block that is pressed onto a floor further than it can go, by a support on its top or, held at its bottom, by a
    ram that moves at 2 m/s: how far the pusher is behind its time, and where it is, taken back to the first frame.

    Parameters
    ----------
    angle, drift : as `world` takes them
    """
    R = rotation_matrix(angle, AXIS, d)
    seen = lambda motion: Sequential((motion, Translation(tuple(drift))))
    up = R[:, -1]
    press, along = seen(Translation(tuple(-2.0 * up))), Translation(tuple(drift))
    ram = polyline([(-0.1, 0.22), (0.3, 0.22), (0.3, 0.3), (-0.1, 0.3)])
    scene = make_scene(
        (SOFT,),
        dt=DT,
        supports=(
            Support(lambda X: (X @ R)[:, -1] > 0.19, motion=press)
            if pusher == "support"
            else Support(lambda X: (X @ R)[:, -1] < 0.6 * DHAT + 1e-9, motion=along),
        ),
        obstacles=(
            Plane((0.0,) * d, tuple(up), along, name="floor"),
            *((Rigid("ram", motion=press, name="ram"),) if pusher == "ram" else ()),
        ),
        contact=(Barrier(dhat=DHAT),),
        solver=Solver(tolerance=1e-6, linear="direct"),
    )
    mesh = block((0.0,) * (d - 1) + (0.6 * DHAT,), (0.2,) * d, 2)
    mesh = level(mesh.points @ R.T, mesh.cells, mesh.bodies)
    problem = make_stepper(scene, mesh, [(ram[0] @ R.T, *ram[1:])] if pusher == "ram" else [])
    *_, report = march(problem, 12, velocity=np.zeros_like(mesh.points) + drift)
    surface, held = problem.potential.contacts[0].surface, problem.model.supports[0].mask
    place = surface.obstacle_positions[: len(ram[0])] if pusher == "ram" else report.positions[held]
    return report.behind, (place - np.asarray(drift) * report.time) @ R


@pytest.mark.parametrize("d, pusher", [(3, "support"), (2, "ram")])
def test_what_contact_holds_back_waits_on_the_floor_of_a_lift(d, pusher):
    """A lift that goes up and sideways in a world that is turned: the pusher is at the same place over the floor. How
    far it gets depends on the parts of its motion.
    """
    behind, alone = pressed(d, pusher, 0.0, np.zeros(d))
    assert behind > 0.01
    late, seen = pressed(d, pusher, 0.9, np.array([2.0, -1.5, 1.0][:d]))
    np.testing.assert_allclose(late, behind, rtol=0.0, atol=0.002)
    np.testing.assert_allclose(seen, alone, rtol=0.0, atol=0.005)


# ---- which plane motions wait on


UP, LIFT, STILL = Translation((0.0, 0.5)), Translation((0.0, 0.5)), Plane((0.0, 0.0), (0.0, 1.0)).motion
LIFTED_WALK = Sequential((Translation((1.0, 0.0)), UP))


@pytest.mark.parametrize(
    "planes, supports, ground",
    [
        ([UP], [LIFTED_WALK], 0),  # a lift, and a hand in it
        ([lambda X, t: X + t * np.array([0.0, 0.5])], [LIFTED_WALK], 0),  # the user's own motion
        ([LIFTED_WALK, UP], [LIFT], 1),  # a wall that moves in the lift, and a support that does not
        ([UP], [LIFTED_WALK, STILL], None),  # something stands still
        ([UP, Translation((0.0, -0.5))], [], None),  # two plates that close
        ([STILL], [UP], None),
        ([], [UP, UP], None),
        ([Rotation(0.3, (0.0, 0.0))], [Rotation(0.3, (0.0, 0.0)), UP], 0),  # a turntable
    ],
)
def test_the_ground_is_the_plane_that_most_go_along_with_where_nothing_stands_still(planes, supports, ground):
    obstacles = [plane_obstacle(Plane((0.0, i), (0.0, 1.0), motion)) for i, motion in enumerate(planes)]
    held = [Support(lambda X: X[:, 0] > 0.0, motion=motion) for motion in supports]
    found = ground_of(held, obstacles, 2.0)
    assert found == (() if ground is None else (obstacles[ground],))


def test_what_waits_keeps_its_place_on_the_ground_and_catches_up_from_there():
    """A hand goes by 1 m/s to the right in a lift that rises by 0.5 m/s; it waits from 0.2 to 0.3 s and is on time
    again at 0.4 s.
    """
    floor = plane_obstacle(Plane((0.0, 0.0), (0.0, 1.0), UP))
    hand = plane_obstacle(Plane((5.0, 0.0), (-1.0, 0.0), LIFTED_WALK))
    script = Script((), (floor, hand), (floor,))
    at = lambda clock: script.pose(hand, clock)(np.zeros((1, 2)))[0]
    script.begin(0.2, 0.3, {})
    script.stop([hand], 0.2)
    np.testing.assert_allclose(at(0.3), (0.2, 0.15), atol=1e-15)
    script.begin(0.3, 0.4, {hand: script.lag(hand, 0.3)})
    for clock, place in ((0.3, (0.2, 0.15)), (0.35, (0.3, 0.175)), (0.4, (0.4, 0.2))):
        np.testing.assert_allclose(at(clock), place, atol=1e-15)
    assert script.lag(hand, 0.4) == 0.0 and not script.moves(floor, 0.3, 0.4) and script.moves(hand, 0.3, 0.4)
