"""Steps at rest: a heap that has settled costs nothing, no slow motion is lost, and what changes wakes everything."""

import numpy as np
import pytest

import pdvol
from on_ranks import results_on
from pdvol.integrate.integrator import BDF2, ImplicitEuler, leading_past, past_of
from pdvol.integrate.marches import Start, direct
from pdvol.registry import INTEGRATORS
from pdvol.scene import (
    Barrier,
    Body,
    Force,
    Friction,
    Gravity,
    Impulse,
    Keyed,
    Muscle,
    NeoHookean,
    Plane,
    PointForce,
    Pressure,
    Relative,
    Scene,
    Solver,
    Support,
    Translation,
)
from pdvol.scene import (
    Path as Keyframes,
)
from problems import block, make_scene, make_stepper
from shapes import grid, together

G, DT, TOLERANCE = 9.81, 0.01, 1e-3
DAMPED = NeoHookean(young=1e5, poisson=0.3, density=1000.0, damping=0.05)
FLOOR = Plane((0.0, 0.0), (0.0, 1.0))


def heap(steps, **more):
    """Three damped blocks fall on each other, by 3, 6 and 9 cm, and come to rest within a second or two."""
    mesh = together(*(block((0.01 * i, 0.13 * i + 0.03), (0.2 + 0.01 * i, 0.13 * i + 0.13), 2) for i in range(3)))
    more = {"obstacles": (FLOOR,), "loads": (Gravity((0.0, -G)),)} | more
    contact = (Barrier(dhat=2e-3), Friction(0.4, eps_v=1e-3))
    return make_scene(
        (DAMPED,) * 3, dt=DT, steps=steps, contact=contact, solver=Solver(tolerance=TOLERANCE), **more
    ), mesh


def march(scene, mesh, name="implicit_euler", velocity=0.0):
    start = Start.at_rest(mesh.points, np.zeros_like(mesh.points) + velocity)
    return list(direct(make_stepper(scene, mesh, integrator=INTEGRATORS[name]()), start, scene.steps))


@pytest.fixture
def never_at_rest(monkeypatch):
    return lambda: monkeypatch.setattr("pdvol.integrate.rest.Rest.lasts", lambda *_: False)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_heap_that_has_come_to_rest_costs_next_to_nothing(name, never_at_rest):
    """One iteration in twenty of those of its fall, and it lies where it would if every step was solved."""
    scene, mesh = heap(400)
    reports = march(scene, mesh, name)
    iterations = np.array([report.newton_iterations for report in reports])
    assert iterations[-100:].mean() <= 0.05 * iterations[:50].mean()
    held = [report for report in reports if report.joined == 0]
    assert {report.reason for report in held} == {"AT_REST"}
    assert all(report.newton_iterations == report.hessians == 0 and report.contacts > 0 for report in held)
    joined = sum(report.joined for report in reports) + reports[-1].rest["steps"]
    assert joined == scene.steps, "joined steps fill the time of those at rest"
    assert max(report.joined for report in reports) >= 20
    never_at_rest()
    solved = march(scene, mesh, name)
    np.testing.assert_allclose(reports[-1].positions, solved[-1].positions, atol=2.0 * TOLERANCE * DT)


@pytest.mark.parametrize("name", INTEGRATORS)
@pytest.mark.parametrize("at", [399, 250, 120])
def test_resumed_equals_uninterrupted_at_rest(name, at):
    """To the last bit, in a step at rest, after one, and before."""
    scene, mesh = heap(400)
    whole, mine = march(scene, mesh, name), INTEGRATORS[name]()
    step = next(n for n in range(at, 0, -1) if whole[n - 1].joined == 0) if at > 200 else at
    for number in {step, min(step + 1, 398)}:
        positions = lambda n: mesh.points if n == 0 else whole[n - 1].positions
        record = lambda n: whole[n - 1].record()
        past = past_of(mine, positions, np.zeros_like(mesh.points), number, DT, record)
        start = Start(number, past, whole[number - 1].record())
        resumed = list(direct(make_stepper(scene, mesh, integrator=mine), start, scene.steps))
        for a, b in zip(whole[number:], resumed, strict=True):
            np.testing.assert_array_equal(a.positions, b.positions)
            assert (a.joined, a.newton_iterations, a.energy) == (b.joined, b.newton_iterations, b.energy)


def test_a_fall_over_tiny_steps_is_a_fall():
    """A step of 1e-5 s gains a tenth of the tolerance in speed: ten are joined, and nothing is lost."""
    dt, steps = 1e-5, 400
    scene = make_scene(dt=dt, steps=steps, loads=(Gravity((0.0, -G)),), solver=Solver(tolerance=TOLERANCE))
    mesh = block((0.0, 0.0), (0.1, 0.1), 1)
    reports, time = march(scene, mesh), steps * dt
    assert reports[0].joined == 1 and max(report.joined for report in reports) > 1
    fallen = mesh.points[:, 1] - reports[-1].positions[:, 1]
    np.testing.assert_allclose(fallen, 0.5 * G * time**2, atol=TOLERANCE * time)
    speed = (reports[-2].positions - reports[-1].positions)[:, 1] / dt
    np.testing.assert_allclose(speed, G * time, atol=TOLERANCE)


@pytest.mark.parametrize("held", [1.01, 0.997])
def test_slow_slides_and_creeping_go_on(held, never_at_rest):
    """On a slope that friction just holds, the block creeps; on one that it just does not, it starts to slide, by less
    than the tolerance in each step. Either way it gets as far as where every step is solved.
    """
    tangent, steps, tolerance, eps_v = 0.5, 60, 1e-2, 1e-3
    angle = np.arctan(tangent)
    scene = make_scene(
        (DAMPED,),
        dt=DT,
        steps=steps,
        loads=(Gravity((G * np.sin(angle), -G * np.cos(angle))),),
        obstacles=(FLOOR,),
        contact=(Barrier(dhat=2e-3), Friction(held * tangent, eps_v=eps_v)),
        solver=Solver(tolerance=tolerance),
    )
    mesh = block((0.0, 1.9267e-3), (0.2, 0.1), (4, 2))  # its gap at rest
    reports = march(scene, mesh)
    assert any(report.joined == 0 for report in reports)
    never_at_rest()
    solved = march(scene, mesh)
    way = lambda reports: (reports[-1].positions - mesh.points)[:, 0].mean()
    assert way(solved) > 10 * eps_v * DT
    assert abs(way(reports) - way(solved)) <= 0.1 * tolerance * steps * DT
    speed = lambda reports: (reports[-1].positions - reports[-16].positions)[:, 0].mean() / (15 * DT)
    assert abs(speed(reports) - speed(solved)) <= 0.2 * tolerance


def test_what_is_scripted_wakes_bodies():
    """An impulse, a support that lets go, and a force that changes act in the step that they should act in."""
    dt, steps, at = 0.01, 40, 0.2
    mesh = block((0.0, 0.0), (0.1, 0.1), 1)
    still = {"dt": dt, "steps": steps, "solver": Solver(tolerance=TOLERANCE)}

    def heights(**physics):
        reports = march(make_scene(**still, **physics), mesh)
        return np.array([r.positions[:, 1].mean() for r in reports]), [r.joined for r in reports]

    y, joined = heights(loads=(Impulse((0.0, 1.0), time=at),))
    np.testing.assert_allclose(np.diff(y), np.where(np.arange(2, steps + 1) * dt > at + 1e-9, dt, 0.0), atol=1e-9)
    assert joined[-1] == 1
    hold = Support(lambda X: X[:, 1] > 0.09, release=at)
    y, joined = heights(loads=(Gravity((0.0, -G)),), supports=(hold,), obstacles=(), contact=())
    fall = np.diff(y)[21:] / dt
    np.testing.assert_allclose(np.diff(fall), -G * dt, atol=0.05 * G * dt)
    y, joined = heights(loads=(PointForce((0.0, 0.0), at=(0.05, 0.05)),))
    assert joined[1:] == [0] * (steps - 1), "what nothing moves is solved once"


@pytest.mark.parametrize(
    "physics",
    [
        lambda of: {"loads": (Force(of((0.0, 0.0), lambda t: (0.0, 0.0))),)},
        lambda of: {"loads": (Pressure("body 0", of(0.0, lambda t: 0.0)),)},
        lambda of: {"muscles": (Muscle("body 0", (1.0, 0.0), 1.0, of(0.0, lambda t, X: 0.0 * X[:, 0])),)},
        lambda of: {"materials": (NeoHookean(of(1e5, Keyed((0.0, 1.0), (1e5, 2e5)))),)},
    ],
    ids=["force", "pressure", "muscle", "young"],
)
def test_what_follows_time_keeps_bodies_awake(physics):
    """Also where it happens to do nothing."""
    mesh = block((0.0, 0.0), (0.1, 0.1), 1)
    for of, joined in ((lambda still, timed: still, [1, 0, 0]), (lambda still, timed: timed, [1, 1, 1])):
        reports = march(make_scene(steps=3, **physics(of)), mesh)
        assert [report.joined for report in reports] == joined


def test_steps_rest_while_no_motion_moves_anything():
    """A lift below a block rests, goes up between two keys, and rests again: bodies do so, too."""
    keys = Keyframes((0.2, 0.3), ((0.0, 0.0), (0.0, 0.02)))
    scene, mesh = heap(50, obstacles=(Plane((0.0, -0.5), (0.0, 1.0), motion=keys),), loads=())
    reports = list(march(scene, mesh))
    moving = [0.2 - 1e-9 < report.time - scene.dt < 0.3 - 1e-9 for report in reports]
    assert {report.joined for report, moves in zip(reports, moving, strict=True) if moves} == {1}
    resting = [report.joined == 0 for report, moves in zip(reports, moving, strict=True) if not moves]
    assert sum(resting) >= len(resting) - 3


def settle(comm):
    scene, mesh = heap(250)
    start = Start.at_rest(mesh.points, 0.0 * mesh.points)
    reports = list(direct(make_stepper(scene, mesh, comm=comm), start, scene.steps))
    positions, joined = [r.positions for r in reports], [r.joined for r in reports]
    return {"positions": positions, "joined": joined}


@pytest.mark.mpi
def test_one_rank_and_two_rest_alike():
    one, two = results_on((1, 2), settle)
    assert one["joined"].min() == 0 and two["joined"].min() == 0
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=TOLERANCE * DT)


@pytest.mark.parametrize("integrator", [ImplicitEuler(), BDF2()])
def test_a_finer_level_makes_the_jump_after_a_rest_once(integrator):
    """A level at rest makes up for all the time since in one step. Differences over it would lead the finer level by
    5/3, -7/9 and 1/9 of the way.
    """
    places = np.cumsum([0.0, 0.3, 0.2, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.2, 0.3, 0.3, 0.2])[:, None, None] * np.ones(
        (1, 2, 3)
    )
    velocity = np.zeros((2, 3))

    def way(step, past=leading_past):
        x = past(integrator, places.__getitem__, velocity, step, DT)
        return (integrator.predict(x, DT) - places[step])[0, 0]

    assert [way(step) for step in (4, 5, 6, 7, 8)] == pytest.approx([0.0, 1.0, 0.0, 0.0, 0.0], abs=1e-12)
    assert [way(step) for step in (1, 2, 12)] == pytest.approx([way(step, past_of) for step in (1, 2, 12)])


def speeds(centre: np.ndarray) -> list[float]:
    """Mean speeds of two levels of a block that floats for one step, which is solved, before a wall comes."""
    levels = []
    for n in (2, 4):
        mesh = grid(np.linspace(0.0, 0.3, n + 1), np.linspace(0.0, 0.2, n + 1))
        levels.append(pdvol.Solid(mesh.points + centre, mesh.cells.astype(np.int32), mesh.regions))
    wall = Plane(tuple(centre + [-0.01, 0.0]), (1.0, 0.0), Translation((0.7, 0.0)))
    scene = Scene(
        (Body(tuple(levels), NeoHookean(5e5, 0.3, 1000.0)),),
        obstacles=(wall,),
        contact=(Barrier(),),
        dt=0.01,
        steps=3,
        solver=Solver(tolerance=Relative(1e-6)),
    )
    return [float(step.velocity[:, 0].mean()) for step in pdvol.march(scene)]


@pytest.mark.parametrize("place", [(1.0, 0.0), (1.04, -1.29), (7.7, -2.2)])
def test_a_solved_step_without_motion_is_no_rest(place):
    """Positions differ by round-off in it, or repeat to the last bit, as the place has it: level 1 goes alike."""
    there, here = speeds(np.array(place)), speeds(np.zeros(2))
    assert here[1] > 0.3 and here[-1] > 0.7
    assert there == pytest.approx(here, abs=1e-5)
