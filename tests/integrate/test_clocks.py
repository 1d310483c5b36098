"""Motions have clocks of their own: what contact stops waits, and all others go on."""

import json

import numpy as np
import pytest
from test_motions import crosses

from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.integrate.integrator import past_of
from pdvol.integrate.marches import Start, direct
from pdvol.registry import INTEGRATORS
from pdvol.scene import Barrier, Friction, Plane, Rigid, Solver, Support, Translation
from pdvol.scene import Path as Keys
from problems import SOFT, block, make_scene, make_stepper, march, polyline, tetrahedron
from shapes import together

SOLVER = Solver(tolerance=1e-4, linear="direct")
DT = 0.02


def ram(d, side=0.05):
    """A block-like obstacle's geometry above the origin, its lower side at height 0.25."""
    if d == 2:
        return polyline([(-side, 0.25), (side, 0.25), (side, 0.35), (-side, 0.35)])
    return tetrahedron([(0.0, 0.0, 0.25), (0.2, 0.0, 0.5), (-0.2, 0.2, 0.5), (-0.2, -0.2, 0.5)])


def pressed_and_driven(d, script):
    """A ram goes up and down by `script` onto a block that is held below; a support leads another block to the right,
    and a floor goes to the right below a third one, which rests on it.
    """

    def at(place, n=2):
        low = np.r_[place - 0.2, (-0.2,) * (d - 2), 0.0]
        return block(low, low + np.array([0.4] * (d - 1) + [0.2]), n)

    down, speed = -np.eye(d)[-1], tuple(np.eye(d)[0])
    scene = make_scene(
        (SOFT,) * 3,
        dt=DT,
        supports=(
            Support(lambda X: X[:, -1] < 1e-9, body="body 0"),
            Support(lambda X: X[:, -1] < 1e-9, body="body 1", motion=Translation(speed)),
        ),
        obstacles=(
            Rigid("ram", motion=Keys(script[0], [tuple(-h * down) for h in script[1]]), name="ram"),
            Plane(tuple(np.eye(d)[-1] * -0.004), tuple(np.eye(d)[-1]), Translation(speed), name="floor"),
        ),
        contact=(Barrier(dhat=5e-3), Friction(0.5)),
        solver=SOLVER,
    )
    return scene, together(at(0.0, (4, 2) if d == 2 else 2), at(1.0), at(-1.0))


DOWN = ((0.0, 1.0), (0.0, -5.0))
DOWN_AND_UP = ((0.0, 0.06, 0.16), (0.0, -0.3, 0.0))


@pytest.mark.parametrize("d", [2, 3])
def test_what_contact_stops_waits_and_what_it_does_not_stop_goes_on(d):
    scene, mesh = pressed_and_driven(d, DOWN)
    geometry = ram(d)
    problem = make_stepper(scene, mesh, [geometry])
    held = (mesh.points[:, -1] < 1e-9) & (mesh.point_bodies == 1)
    obstacle, floor = problem.model.obstacles
    surface = problem.potential.contacts[-1].surface
    last = 0.0
    for report in march(problem, 6):
        np.testing.assert_allclose(report.positions[held], mesh.points[held] + report.time * np.eye(d)[0], atol=1e-12)
        at = obstacle.at(report.time - report.behind)
        now, of_floor = np.split(surface.obstacle_positions, [len(at)])  # planes come last
        np.testing.assert_allclose(of_floor, floor.at(report.time), atol=1e-14)
        np.testing.assert_allclose(now, at, atol=1e-12)
        assert not crosses(mesh, report.positions, (at, *geometry[1:]))
        assert simplex_volumes(report.positions, mesh.cells).min() > 0.0
        assert report.late == ({"obstacle 0": report.behind} if report.behind > 0.0 else {})
        assert report.reached == pytest.approx(1.0 - report.behind / (DT + last), abs=1e-11)
        last = report.behind
    assert report.behind > 0.03 and report.reached < 0.1


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_late_motion_catches_up_and_others_do_not_wait_for_it(name):
    """The ram is on time again when its script is back where it began. A march that goes on from the log repeats to the
    last bit: from the first step with a late motion, or from the one after it, whose slips still see the late one.
    """
    scene, mesh = pressed_and_driven(2, DOWN_AND_UP)
    integrator, still = INTEGRATORS[name](), 0.0 * mesh.points
    begin = lambda: make_stepper(scene, mesh, [ram(2)], integrator=integrator)
    whole = list(direct(begin(), Start.at_rest(mesh.points, still), 9))
    held, behind = (mesh.points[:, -1] < 1e-9) & (mesh.point_bodies == 1), [report.behind for report in whole]
    for report in whole:
        np.testing.assert_allclose(report.positions[held], mesh.points[held] + [report.time, 0.0], atol=1e-12)
    assert max(behind) > 0.01 and behind[-1] == 0.0 and report.late == {} and report.reached == 1.0
    late = next(report.step for report in whole if report.late)
    records = [{}, *(json.loads(json.dumps(report.record())) for report in whole)]
    positions = lambda step: whole[step - 1].positions if step else mesh.points
    for step in (late, late + 1):
        past = past_of(integrator, positions, still, step, DT, records.__getitem__)
        start = Start(step, past, records[step], [records[step - 1]])
        for report, expected in zip(direct(begin(), start, 9), whole[step:], strict=True):
            np.testing.assert_array_equal(report.positions, expected.positions)
            assert (report.behind, report.late) == (expected.behind, expected.late)


def test_two_plates_that_squeeze_a_body_stop_both():
    """Neither goes on alone: they stay as far from the middle as each other."""
    mesh = block((-0.1, 0.0), (0.1, 0.2), (4, 4))
    plates = [Plane((s * 0.12, 0.0), (-s, 0.0), Translation((-s * 1.0, 0.0)), name=f"plate {s}") for s in (-1.0, 1.0)]
    scene = make_scene(dt=DT, obstacles=tuple(plates), contact=(Barrier(dhat=5e-3),), solver=SOLVER)
    problem = make_stepper(scene, mesh)
    for report in march(problem, 8):
        assert simplex_volumes(report.positions, mesh.cells).min() > 0.0
    lags = [report.late.get(f"obstacle {i}", report.behind if not report.late else 0.0) for i in (0, 1)]
    assert min(lags) > 0.01 and abs(lags[0] - lags[1]) < 0.02
    places = [plate.at(report.time - lag)[0, 0] for plate, lag in zip(problem.model.obstacles, lags, strict=True)]
    assert places[0] < report.positions[:, 0].min() and report.positions[:, 0].max() < places[1]
