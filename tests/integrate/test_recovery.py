"""Each remedy is applied where it is needed, and is counted. A value that is not a number ends a run at once, and the
error names its source.
"""

import numpy as np
import pytest
import ufl
from petsc4py import PETSc

from pdvol.errors import ConvergenceError, InputError
from pdvol.integrate.scripted_motion import MotionParts
from pdvol.potentials.potential import Positions, Term
from pdvol.scene import Barrier, NeoHookean, Solver, Translation
from pdvol.solve.report import REMEDIES, no_remedies, taken
from problems import block, ground, make_scene, make_stepper, march, take_step, weight
from shapes import together

REASONS = PETSc.SNES.ConvergedReason


def falling(**settings):
    """A block thrown at a plane it stands before, and a velocity for it."""
    scene = make_scene(
        dt=0.02,
        loads=(weight(2),),
        obstacles=ground(2)[:1],
        contact=(Barrier(dhat=0.01),),
        solver=Solver(tolerance=1e-5, **settings),
    )
    mesh = block((0.0, 0.02), (0.4, 0.42), 2, jitter=0.1)
    return make_stepper(scene, mesh), mesh.points, np.tile((0.0, -4.0), (len(mesh.points), 1))


# ---- remedies


def test_the_order_within_a_solve():
    """An easy step takes no remedy. Failures of one kind follow each other. The remedies are a stronger projection,
    then a direct solver; after that no remedy is left.
    """
    problem, x, v = falling(linear="auto")
    assert take_step(problem, 1, x, v).remedies == no_remedies()
    assert taken(no_remedies()) == "" and taken({**no_remedies(), "abs": 2, "halvings": 1}) == "abs 2, halvings 1"
    newton = problem.newton
    solve = newton.start(Positions(problem.space, problem.space.from_input(x)))
    solve.projection = "none"
    remedies = []
    for _ in range(5):
        before = dict(solve.report.remedies)
        go_on = newton.remedy(REASONS.DIVERGED_LINE_SEARCH)
        new = [name for name in REMEDIES if solve.report.remedies[name] > before[name]]
        assert go_on == (len(new) == 1)
        remedies += new
    assert remedies == ["clamp", "abs", "direct"] and newton.linear.method == "direct"
    assert not newton.remedy(REASONS.DIVERGED_MAX_IT)
    room = []
    while newton.remedy(REASONS.DIVERGED_LINEAR_SOLVE):
        room.append(1)
    assert solve.report.remedies["workspace"] == len(room) == 2
    # The bound counts the Newton iterations of all restarts of one solve together.
    for iterations in (newton.settings.max_iterations, newton.settings.max_iterations + 1):
        newton.start(Positions(problem.space, problem.space.from_input(x))).report.iterations = iterations
        assert newton.remedy(REASONS.DIVERGED_LINE_SEARCH) is (iterations == newton.settings.max_iterations)


def test_too_many_iterations_halve_the_step_and_end_with_an_error():
    """Two Newton iterations are never enough here. The step is halved, quartered and tried with the last remedy. Then
    an error reports all of these.
    """
    (problem, x, v), number = falling(max_iterations=2, max_halvings=2), 1
    with pytest.raises(ConvergenceError) as caught:
        for report in march(problem, 20, x, v):
            number = report.step + 1
    error = caught.value
    assert error.level == 0 and error.step == number
    assert str(error).startswith(f"level 0, step {number}: DIVERGED_MAX_IT after ")
    assert "halvings" in error.reason and "last_resort 1" in error.reason and "dt = 0.005 s" in error.reason


def test_ground_that_cannot_move_halves_the_step(monkeypatch):
    """What moves with respect to the ground waits for it. The ground itself does not wait: the step is halved until it
    gets there, and ends with an error where it never does.
    """
    floor, _ = ground(2, motion=Translation((0.0, 0.1)))
    scene = make_scene(dt=0.02, obstacles=(floor,), contact=(Barrier(dhat=0.01),))
    mesh = block((0.0, 0.02), (0.4, 0.42), 2)
    problem, follow, still = make_stepper(scene, mesh), MotionParts.follow, np.zeros_like(mesh.points)
    monkeypatch.setattr(problem, "_predicted", lambda *_: None)
    tries = []

    def blocked_at_first(parts, x):
        tries.append(parts)
        return follow(parts, x) if len(tries) > 1 else x

    monkeypatch.setattr(MotionParts, "follow", blocked_at_first)
    report = take_step(problem, 1, mesh.points, still)
    assert report.remedies["halvings"] == 1 and report.cuts == 1
    monkeypatch.setattr(MotionParts, "follow", lambda parts, x: x)
    with pytest.raises(ConvergenceError, match="level 0, step 2: GROUND_BLOCKED after "):
        take_step(problem, 2, report.positions, still)


def test_the_last_resort_can_save_a_step(monkeypatch):
    """At the smallest step the strongest filter and the direct solver are used from the beginning. If they solve the
    step, the run continues.
    """
    problem, x, v = falling(max_halvings=0, linear="iterative")
    solve = problem.newton.solve
    robust_ones = []

    def only_robust(x, robust=False, **more):
        x, report = solve(x, robust, **more)
        robust_ones.append((robust, problem.newton.linear.method))
        report.converged = report.converged and robust
        return x, report

    monkeypatch.setattr(problem.newton, "solve", only_robust)
    report = take_step(problem, 1, x, v)
    assert robust_ones == [(False, "iterative"), (True, "direct")]
    assert report.remedies["last_resort"] == 1 and report.cuts == report.remedies["halvings"] == 0
    assert report.positions[:, 1].min() > 0.0


class Spring(Term):
    """Springs [N/m] to the start, whose Hessian is too small by a factor: Newton's steps are that much too long. Parts
    named `what` go bad from the second step on.
    """

    name = "consistency"  # one that the log has a place for

    def __init__(self, stiffness, factor=1.0, what="", bad=np.nan):
        self.stiffness, self.factor, self.what, self.bad, self.steps = stiffness, factor, what, bad, 0

    def begin_step(self, x_t, t0, t1, x_hat=None):
        self.steps += 1
        self._x_t = x_t

    def _or_bad(self, what, value):
        return self.bad * np.ones_like(value) if what == self.what and self.steps > 1 else value

    def value(self, x):
        return float(self._or_bad("energy", 0.5 * self.stiffness * np.sum((x.owned - self._x_t.owned) ** 2)))

    def gradient(self, x):
        return self._or_bad("gradient", self.stiffness * (x.owned - self._x_t.owned))

    def add_hessian(self, x, weight, into):
        n, block = len(x.owned), self.factor * self.stiffness * weight * np.eye(2)
        into.add_diagonal(np.arange(n), self._or_bad("Hessian", np.tile(block, (n, 1, 1))))
        into.add_pairs(np.array([0]), np.array([1]), self._or_bad("pairs", np.zeros((1, 2, 2))))  # as contact does

    def max_step(self, x, direction, until=None, gap_share=0.1):
        return float(self._or_bad("largest step", np.array(1.0)))


def test_the_line_search_cuts_steps_that_are_far_too_long():
    """By ten powers of ten in one iteration, so that the energy falls and no remedy is needed; in about as many trials,
    where halving needs 34.
    """
    problem, x, v = falling()
    problem.potential.terms = (*problem.potential.terms, Spring(1e15, factor=0.0))
    start = Positions(problem.space, problem.space.from_input(x))
    problem.potential.begin_step(start, start.owned - 0.02 * problem.space.from_input(v), 4e-4, 0.0, 0.02)
    problem.newton.begin_step(0.02)
    end, solved = problem.newton.solve(start, max_iterations=1)
    assert problem.potential.value(end) < problem.potential.value(start)
    assert 0.0 < np.abs(end.owned - start.owned).max() < 1e-9 * 0.08
    assert 5 < solved.backtracks < 15 and solved.remedies == no_remedies()


# ---- what is not a number


@pytest.mark.parametrize(
    "what, bad, said",
    [
        *((what, np.nan, "not a number") for what in ("energy", "gradient", "Hessian", "pairs", "largest step")),
        *((what, np.inf, "infinite") for what in ("energy", "gradient", "Hessian")),
    ],
)
def test_what_is_not_a_number_is_named(what, bad, said):
    problem, x, v = falling()
    problem.potential.terms = (*problem.potential.terms, Spring(1.0, what=what, bad=bad))
    said += " in body 'body 0'" if what in ("gradient", "Hessian") else ""
    report, what = take_step(problem, 1, x, v), what.replace("pairs", "Hessian")
    with pytest.raises(ConvergenceError, match=f"level 0, step 2: the consistency term's {what} is {said}") as caught:
        take_step(problem, 2, report.positions, v)
    assert caught.value.step == 2


def test_an_energy_that_is_not_a_number_in_a_trial_is_a_trial_that_fails():
    """A barrier of a user's own is a logarithm, which ends at the wall: steps stay on this side of it."""
    mesh = block((0.0, 0.0), (1.0, 1.0), 3)
    problem, x = make_stepper(make_scene(), mesh), mesh.points

    class Wall(Term):
        def value(self, x):
            depth = x.owned[:, -1] + 1e-3
            return -np.log(depth).sum() if np.all(depth > 0.0) else np.nan

        def gradient(self, x):
            return np.stack([0.0 * x.owned[:, 0], -1.0 / (x.owned[:, -1] + 1e-3)], axis=1)

        def add_hessian(self, x, weight, into):
            blocks = np.zeros((len(x.owned), 2, 2))
            blocks[:, 1, 1] = weight / (x.owned[:, -1] + 1e-3) ** 2
            into.add_diagonal(np.arange(len(x.owned)), blocks)

    problem.potential.terms = (*problem.potential.terms, Wall())
    report = take_step(problem, 1, x, np.full_like(x, -5.0))
    assert -1e-3 < report.positions[:, -1].min() < 0.0 and report.backtracks > 0 and report.cuts == 0


AT_REST = "^Strange.psi, or its derivative by F, is NaN or infinite at or near F = I$"
LATER = "level 0, step 1: the elastic term's energy is not a number in body 'body 1' after 1 cuts"


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (lambda s: ufl.sqrt(s - 0.1), AT_REST),
        (lambda s: (s - s) ** 0.75, AT_REST),
        (lambda s: 1e2 * ufl.sqrt(1e-4 - s), LATER),
    ],
)
def test_the_law_or_the_body_is_named_whose_density_is_not_a_number(more, said):
    """It was taken for that of an inverted cell. The last law ends at a strain up to which the energy falls."""

    class Strange(NeoHookean):
        @staticmethod
        def psi(F, mu, lmbda):
            return NeoHookean.psi(F, mu, lmbda) + more(ufl.inner(F - ufl.Identity(2), F - ufl.Identity(2)))

    mesh = together(block((0.0, 0.0), (1.0, 1.0), 3), block((2.0, 0.0), (3.0, 1.0), 3))
    with pytest.raises((ConvergenceError, InputError), match=said):
        problem = make_stepper(make_scene((NeoHookean(1e5), Strange(1e5)), solver=Solver(max_halvings=1)), mesh)
        take_step(problem, 1, mesh.points, np.outer(mesh.points[:, 0], (10.0, 0.0)))


def test_velocities_that_are_not_numbers_end_the_step():
    problem, x, v = falling()
    with pytest.raises(ConvergenceError, match="level 0, step 1: the inertia term's gradient is not a number|inertia"):
        take_step(problem, 1, x, v * np.nan)


def test_a_solve_that_contact_cuts_to_nothing_takes_the_next_remedy(monkeypatch):
    """Ten iterations without a step are enough, and the error names the pair with the smallest gap and its place."""
    scene = make_scene(
        dt=0.01,
        loads=(weight(2),),
        obstacles=ground(2)[:1],
        contact=(Barrier(dhat=0.01),),
        solver=Solver(max_halvings=0),
    )
    mesh = block((0.0, 0.005), (0.4, 0.405), 2)
    problem = make_stepper(scene, mesh)
    potential = problem.potential
    monkeypatch.setattr(problem, "_predicted", lambda *_: None)
    monkeypatch.setattr(potential, "max_step", lambda *_, **__: 1e-6)
    with pytest.raises(ConvergenceError) as caught:
        take_step(problem, 1, mesh.points, np.zeros_like(mesh.points))
    said = caught.value.reason
    assert said.startswith("DIVERGED_LINE_SEARCH after 0 cuts") and "abs 2, direct 1" in said
    assert "smallest gap 0.005 m between 'body 0' and 'floor' at (" in said
