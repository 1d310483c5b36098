"""Contact forces at a stored end of a step are those that the march reports, and that the step's last solve saw there.

In the first step the solve's friction is lagged before the end, and the reported one at the end.
"""

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.integrate.integrator import advance
from pdvol.integrate.marches import Start, direct
from pdvol.integrate.replay import Replay
from pdvol.levels.space import LevelSpace
from pdvol.registry import INTEGRATORS
from pdvol.scene import Barrier, Friction, Path, Plane, Rigid, Solver, Support, Translation
from problems import SOFT, block, make_model, make_scene, make_stepper, polyline, spike, weight
from shapes import together

FIRST_RESIDUAL = 0.1  # of the contact forces: between several bodies lagged friction converges slowly


def seen_by(stepper, monkeypatch):
    """The contact forces (n, d) [N] at the end of each solve, with terms as that solve had them."""
    forces, solve = [], stepper.newton.solve
    terms = [term for term in stepper.potential.terms if term.name in ("barrier", "friction")]

    def keep(x, *choices, **more):
        x, report = solve(x, *choices, **more)
        forces.append(stepper.space.to_input(-sum(term.gradient(x) for term in terms)))
        return x, report

    monkeypatch.setattr(stepper.newton, "solve", keep)
    return forces


def march(scene, mesh, geometry, velocity, monkeypatch):
    """For each step: its report, the past at its start, and the contact forces that it reports."""
    integrator = INTEGRATORS[scene.integrator]()
    stepper = make_stepper(scene, mesh, geometry, integrator=integrator, forces=True)
    start = Start.at_rest(mesh.points, velocity)
    forces, past = seen_by(stepper, monkeypatch), start.past
    for report in direct(stepper, start, scene.steps):
        assert report.cuts == 0
        force = report.forces["barrier"] + report.forces["friction"]
        enough = FIRST_RESIDUAL if report.step == 1 else 1e-12
        assert np.linalg.norm(force - forces[-1]) <= enough * np.linalg.norm(force)
        yield report, past, force
        past = advance(integrator, past, report.positions, scene.dt, struck=report.struck > 0)


def replay_of(scene, mesh, geometry):
    return Replay(make_model(scene, mesh, geometry), LevelSpace(mesh, MPI.COMM_WORLD))


def replayed(replay, report, past, **late):
    end = replay.put(report.step, past, report.positions, **late)
    return replay.space.to_input(replay.force(end, replay.contacts))


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("d", [2, 3])
def test_forces_are_those_of_the_step(d, integrator, monkeypatch):
    """Two blocks slide over a floor that moves along and a spike that rises: half-spaces and surfaces rub."""
    e, up = np.eye(d)[0], np.eye(d)[-1]
    low = 0.01
    one = block((0.0,) * (d - 1) + (low,), (0.2,) * (d - 1) + (low + 0.1,), 2 if d == 2 else 1, jitter=0.1)
    two = block((0.02,) * (d - 1) + (low + 0.106,), (0.18,) * (d - 1) + (low + 0.2,), 1)
    mesh = together(one, two)
    bottom = one.points[:, -1].min()
    tip = np.r_[[0.11, 0.08][: d - 1], bottom - 0.007]
    scene = make_scene(
        (SOFT, SOFT),
        dt=0.01,
        steps=12,
        integrator=integrator,
        loads=(weight(d),),
        obstacles=(
            Plane((0.0,) * d, tuple(up), Translation(tuple(0.3 * e))),
            Rigid("spike", motion=Translation(tuple(0.1 * up - 0.2 * e))),
        ),
        contact=(Barrier(dhat=0.006), Friction(0.4, eps_v=0.01, iterations=1)),
        solver=Solver(tolerance=1e-4, linear="direct"),
    )
    velocity = np.zeros_like(mesh.points)
    velocity[mesh.point_bodies == 1] = 0.5 * e - 0.5 * up
    replay, rubbed = replay_of(scene, mesh, (spike(tip),)), 0
    for report, past, force in march(scene, mesh, (spike(tip),), velocity, monkeypatch):
        assert report.behind == 0.0
        found = replayed(replay, report, past)
        np.testing.assert_allclose(found, force, rtol=0.0, atol=1e-9 * max(1.0, np.abs(force).max()))
        rubbed += report.energy["friction"] > 0.0 and np.abs(force[:, 0]).max() > 0.1
    assert rubbed > 3, "nothing rubs"


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_forces_of_obstacles_that_are_held_back(integrator, monkeypatch):
    """A plate and a ram sink onto a held block, with a slip along it, until contact holds them back."""
    ram = polyline([(0.1, 0.31), (0.3, 0.31), (0.3, 0.4), (0.1, 0.4)])
    sink = Path((0.0, 1.0), ((0.0, 0.0), (0.5, -5.0)))
    scene = make_scene(
        dt=0.02,
        steps=8,
        integrator=integrator,
        supports=(Support(lambda X: X[:, 1] < 1e-9),),
        obstacles=(Plane((0.0, 0.3), (0.0, -1.0), sink), Rigid("ram", motion=sink)),
        contact=(Barrier(dhat=5e-3), Friction(0.3, eps_v=0.01, iterations=1)),
        solver=Solver(tolerance=1e-4, linear="direct"),
    )
    mesh = block((0.0, 0.0), (0.4, 0.2), (4, 2))
    replay = replay_of(scene, mesh, (ram,))
    late, held_back, apart = [(0.0, {})], 0, 0
    for report, past, force in march(scene, mesh, (ram,), np.zeros_like(mesh.points), monkeypatch):
        late.append((report.behind, report.late))
        found = replayed(replay, report, past, late=late.__getitem__)
        np.testing.assert_allclose(found, force, rtol=0.0, atol=1e-6 * max(1.0, np.abs(force).max()))
        if late[-2][0] > 0.0:
            held_back += 1
            with np.errstate(all="ignore"):  # obstacles stand where their motions are, in the block
                on_time = replayed(replay, report, past)
            assert not np.allclose(on_time, force, rtol=0.0, atol=1e-3 * np.abs(force).max())
        apart += len(report.late) > 0
    assert held_back > 1 and apart > 0
