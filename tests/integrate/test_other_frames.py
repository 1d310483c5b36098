"""What contact holds back, seen from other frames: the whole world turned, or from something that moves evenly."""

import math

import numpy as np
import pytest

import pdvol
from pdvol.levels.obstacles import ground_of, plane_obstacle
from pdvol.levels.script import HeldPoints, Script
from pdvol.scene import rotation_matrix
from problems import SOFT, block, make_scene, make_stepper, march, polyline
from shapes import level

DHAT, DT = 5e-3, 0.01
AXIS = (0.3, -0.5, 1.0)


def pressed(d, pusher, angle, drift):
    """A block that is pressed onto a floor further than it can go, by a support on its top or, held at its bottom, by a
    ram that moves at 2 m/s: how far the pusher is behind its time, and where it is, taken back to the first frame.

    Parameters
    ----------
    angle : [rad] by which the world is turned about the origin
    drift : (d,) velocity [m/s] added to everything
    """
    R = rotation_matrix(angle, AXIS, d)
    seen = lambda motion: pdvol.Sequential((motion, pdvol.Translation(tuple(drift))))
    up = R[:, -1]
    press, along = seen(pdvol.Translation(tuple(-2.0 * up))), pdvol.Translation(tuple(drift))
    ram = polyline([(-0.1, 0.22), (0.3, 0.22), (0.3, 0.3), (-0.1, 0.3)])
    scene = make_scene(
        (SOFT,),
        dt=DT,
        supports=(
            pdvol.Support(lambda X: (X @ R)[:, -1] > 0.19, motion=press)
            if pusher == "support"
            else pdvol.Support(lambda X: (X @ R)[:, -1] < 0.6 * DHAT + 1e-9, motion=along),
        ),
        obstacles=(
            pdvol.Plane((0.0,) * d, tuple(up), along, name="floor"),
            *((pdvol.Rigid("ram", motion=press, name="ram"),) if pusher == "ram" else ()),
        ),
        contact=(pdvol.Barrier(dhat=DHAT),),
        solver=pdvol.Solver(tolerance=1e-6, linear="direct"),
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


UP, STILL = pdvol.Translation((0.0, 0.5)), pdvol.Plane((0.0, 0.0), (0.0, 1.0)).motion
LIFTED_WALK = pdvol.Sequential((pdvol.Translation((1.0, 0.0)), UP))


@pytest.mark.parametrize(
    "planes, supports, ground",
    [
        ([UP], [LIFTED_WALK], 0),  # a lift, and a hand in it
        ([lambda X, t: X + t * np.array([0.0, 0.5])], [LIFTED_WALK], 0),  # the user's own motion
        ([LIFTED_WALK, UP], [UP], 1),  # a wall that moves in the lift, and a support that does not
        ([LIFTED_WALK, UP], [lambda X, t: X + t * np.array([0.0, 0.5])], 1),  # likewise by a function
        ([UP], [LIFTED_WALK, lambda X, t: X], None),  # something stands still by a function
        ([UP], [LIFTED_WALK, lambda X, t: X + 0.1], None),  # likewise, but elsewhere than at t = 0
        ([UP], [LIFTED_WALK, STILL], None),  # something stands still
        ([UP, pdvol.Translation((0.0, -0.5))], [], None),  # two plates that close
        ([STILL], [UP], None),
        ([], [UP, UP], None),
        ([pdvol.Rotation(0.3, (0.0, 0.0))], [pdvol.Rotation(0.3, (0.0, 0.0)), UP], 0),  # a turntable
    ],
)
def test_the_ground_is_the_plane_that_most_go_along_with_where_nothing_stands_still(planes, supports, ground):
    obstacles = [plane_obstacle(pdvol.Plane((0.0, i), (0.0, 1.0), motion)) for i, motion in enumerate(planes)]
    held = [HeldPoints(np.ones(2, bool), np.diag([1.0, 0.5]), motion, math.inf) for motion in supports]
    assert ground_of([*held, *obstacles], 2.0) == (() if ground is None else (obstacles[ground],))


def test_what_waits_keeps_its_place_on_the_ground_and_catches_up_from_there():
    """A hand goes by 1 m/s to the right in a lift that rises by 0.5 m/s; it waits from 0.2 to 0.3 s and is on time
    again at 0.4 s.
    """
    floor = plane_obstacle(pdvol.Plane((0.0, 0.0), (0.0, 1.0), UP))
    hand = plane_obstacle(pdvol.Plane((5.0, 0.0), (-1.0, 0.0), LIFTED_WALK))
    script = Script((), (floor, hand), (floor,))
    at = lambda clock: script.pose(hand, clock)(np.zeros((1, 2)))[0]
    script.begin(0.2, 0.3, {})
    script.stop([hand], 0.2)
    np.testing.assert_allclose(at(0.3), (0.2, 0.15), atol=1e-15)
    script.begin(0.3, 0.4, {hand: script.lag(hand, 0.3)})
    for clock, place in ((0.3, (0.2, 0.15)), (0.35, (0.3, 0.175)), (0.4, (0.4, 0.2))):
        np.testing.assert_allclose(at(clock), place, atol=1e-15)
    assert script.lag(hand, 0.4) == 0.0 and not script.moves(floor, 0.3, 0.4) and script.moves(hand, 0.3, 0.4)
