"""Newton must not stop deep inside a barrier, where its steps are short although the solution is still far away. A
solver must not outlive its level.
"""

import gc
import weakref

import numpy as np
import pytest

from pdvol.scene import Barrier, Gravity, Solver, Support, Translation
from pdvol.solve import newton
from pdvol.solve.linear.solver import LinearSolver
from pdvol.solve.newton import Newton
from problems import block, ground, make_scene, make_stepper, march, take_step

DHAT = 0.01


@pytest.mark.parametrize("obstacle", ["plane", "surface"])
@pytest.mark.parametrize("gap", [1e-4, 1e-10])
def test_a_body_deep_inside_a_barrier_comes_out(obstacle, gap):
    """A block at rest is a millionth of dhat or less away from the surface that pushes it. The step ends where the
    forces balance, not where it began.
    """
    floor, geometry = ground(2, obstacle)
    scene = make_scene(dt=0.01, obstacles=(floor,), contact=(Barrier(dhat=DHAT),), solver=Solver(tolerance=1e-3))
    mesh = block((0.0, gap * DHAT), (0.4, 0.4 + gap * DHAT), 2)
    problem = make_stepper(scene, mesh, geometry)
    report = take_step(problem, 1, mesh.points, np.zeros_like(mesh.points))
    assert report.min_gap > 0.05 * DHAT
    assert report.gradient_norm < 1e-3 * 0.01 * problem.potential.mass.max()


def impact(**settings):
    """The step in which a block that falls at 3 m/s meets the floor, after four steps in the air."""
    solver = Solver(tolerance=1e-5, **settings)
    scene = make_scene(dt=0.01, obstacles=ground(2)[:1], contact=(Barrier(dhat=DHAT),), solver=solver)
    mesh = block((0.0, 0.02), (0.4, 0.42), 4)
    problem = make_stepper(scene, mesh, ())
    return take_step(problem, 1, mesh.points, np.full_like(mesh.points, (0.0, -3.0)))


def test_a_relative_tolerance_ends_impacts_earlier_and_near_the_same_state():
    """The velocity changes by 3 m/s; what is left of it is a few times the share that was allowed."""
    strict, loose = impact(), impact(relative_tolerance=0.01)
    assert loose.newton_iterations < strict.newton_iterations
    left = np.linalg.norm(loose.positions - strict.positions, axis=1).max() / 0.01
    assert 0.0 < left < 3.0 * 0.01 * 3.0


def test_the_relative_tolerance_is_one_of_the_change_of_velocity():
    """A slow turn hardly changes velocities, and so the step is solved nearly as strictly as without."""
    mesh = block((0.0, 0.0), (0.4, 0.4), 4)
    turning = 0.5 * (mesh.points - 0.2) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    ends = []
    for share in (0.0, 0.1):
        scene = make_scene(dt=0.01, solver=Solver(tolerance=1e-5, relative_tolerance=share))
        ends.append(take_step(make_stepper(scene, mesh, ()), 1, mesh.points, turning).positions)
    change = np.linalg.norm((ends[0] - mesh.points) / 0.01 - turning, axis=1).max()
    left = np.linalg.norm(ends[1] - ends[0], axis=1).max() / 0.01
    assert change < 0.02 and left <= 3.0 * max(1e-5, 0.1 * change)


# ---- bars that buckle: every filtered Hessian is too stiff, and lengthened steps save most of the iterations


def pressed(press, tolerance=1e-4):
    """A slender bar, straight but for a breath of gravity, is pressed to 1 - `press` of its length in a step: the
    report.
    """
    far = Support(lambda X: X[:, 0] > 1.0 - 1e-9, motion=Translation((-press / 0.1, 0.0, 0.0), stop=0.1))
    scene = make_scene(
        dt=0.1,
        supports=(Support(lambda X: X[:, 0] < 1e-9), far),
        loads=(Gravity((0.0, -1e-3, 0.0)),),
        solver=Solver(tolerance=tolerance, max_iterations=1000, linear="direct"),
    )
    mesh = block((0.0, 0.0, 0.0), (1.0, 0.04, 0.04), (40, 1, 1))
    return take_step(make_stepper(scene, mesh), 1, mesh.points, np.zeros_like(mesh.points))


@pytest.mark.parametrize("press", [0.2, 0.4])
def test_a_bar_that_buckles_takes_fewer_steps_and_comes_nearer_to_its_end(monkeypatch, press):
    """Without lengthening, each step is a few per cent shorter than the one before. The tolerance is then reached long
    before the end (1 mm early at 0.4).
    """
    lengthened, end = pressed(press), pressed(press, tolerance=1e-6)
    monkeypatch.setattr(newton, "step_factor", lambda *_: 1.0)
    plain = pressed(press)
    missed, missed_by_plain = (np.abs(report.positions - end.positions).max() for report in (lengthened, plain))
    assert np.abs(end.positions[:, 1] - 0.02).max() > 0.05
    assert missed < 1e-4 and missed < max(1e-5, 2.0 * missed_by_plain)
    assert lengthened.newton_iterations < plain.newton_iterations
    assert lengthened.cuts == plain.cuts == end.cuts == 0


# ---- the end of a solver


@pytest.mark.parametrize("linear", ["direct", "iterative"])
def test_a_solver_ends_with_its_level(linear):
    """PETSc keeps neither: a process may solve any number of levels. With MPICH it has 2,048 communicators for all."""
    stepper = make_stepper(make_scene(solver=Solver(tolerance=1e-6, linear=linear)), block((0.0, 0.0), (0.4, 0.4), 2))
    assert len(list(march(stepper, 1))) == 1
    kept = weakref.ref(stepper.space), weakref.ref(stepper.newton)
    del stepper
    gc.collect()
    assert [each() for each in kept] == [None, None]


def test_an_interrupt_in_a_solve_within_a_callback_arrives(monkeypatch):
    """PETSc wraps it once for each solve. An interrupted run ends as such, and not with PETSc's error."""
    again, solve_once = [], LinearSolver.solve_once

    def interrupted(self, *arguments):
        if again:
            raise KeyboardInterrupt
        return solve_once(self, *arguments)

    def solve_again(self, x, step):
        again.append(True)
        self.system.solve(self._residual, step)

    monkeypatch.setattr(LinearSolver, "solve_once", interrupted)
    monkeypatch.setattr(Newton, "_predict", solve_again)
    mesh = block((0.0, 0.0), (0.4, 0.4), 2)
    with pytest.raises(KeyboardInterrupt):
        take_step(make_stepper(make_scene(), mesh), 1, mesh.points, mesh.points)
    assert again
