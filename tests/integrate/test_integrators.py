"""Time integrators: their order in dt, their damping, the past they are given, and what a cut step leaves."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from pdvol.integrate.integrator import BDF2, ImplicitEuler, Past, advance, past_of
from pdvol.integrate.marches import Start, direct
from pdvol.potentials.potential import Positions
from pdvol.registry import INTEGRATORS
from pdvol.scene import Impulse, NeoHookean, Solver, Support
from problems import block, fail_solve, make_scene, make_stepper, masses, take_step, weight

G = 9.81
BAR = NeoHookean(young=1e5, poisson=0.3, density=1000.0)
STRAIN = 1e-2  # of the free oscillation at the clamped end
TOLERANCE = 1e-9  # of the solver [m/s], beside speeds of about 0.1 m/s


def left(X):
    return X[:, 0] < 1e-9


class Oscillation:
    """A bar clamped at x = 0 swings along itself, from rest positions with the velocity of its first such mode."""

    def __init__(self, d):
        self.mesh = block((0.0,) * d, (1.0,) + (0.2,) * (d - 1), (3,) + (1,) * (d - 1))
        self.problem = make_stepper(self.scene(0.01, 1), self.mesh)
        self.mass = masses(self.problem)
        self.free = ~left(self.mesh.points)
        # The stiffness matrix at rest, by central differences of the forces.
        X, n = self.mesh.points[self.free], self.free.sum() * d
        ends = [[self.acceleration(X.ravel() + h * row) for h in (1e-5, -1e-5)] for row in np.eye(n)]
        m = np.repeat(self.mass[self.free], d)
        stiffness = -m[:, None] * np.array([(a - b) / 2e-5 for a, b in ends]).T
        squares, modes = eigh((stiffness + stiffness.T) / 2.0, np.diag(m))
        along = (np.sin(np.pi * X[:, :1] / 2.0) * np.eye(d)[0]).ravel()
        first = int(np.argmax(np.abs(modes.T @ (m * along))))
        self.omega = float(np.sqrt(squares[first]))
        mode = modes[:, first].reshape(-1, d)
        self.velocity = np.zeros_like(self.mesh.points)
        self.velocity[self.free] = STRAIN * self.omega * mode / np.abs(mode).max()

    def scene(self, dt, steps):
        solver = Solver(tolerance=TOLERANCE, linear="direct")
        return make_scene((BAR,), dt=dt, steps=steps, supports=(Support(left),), solver=solver)

    def at(self, free):
        """Positions from the flat coordinates of vertices that are free."""
        x = self.mesh.points.copy()
        x[self.free] = free.reshape(-1, self.mesh.dim)
        return Positions(self.problem.space, self.problem.space.from_input(x))

    def acceleration(self, free):
        x = self.at(free)
        force = -sum(term.gradient(x) for term in self.problem.potential.terms)
        return (self.problem.space.to_input(force)[self.free] / self.mass[self.free, None]).ravel()

    def exact(self, end):
        """Positions (n, d) at a time, by a method of order 8 that shares nothing with pdvol's."""
        X, v = self.mesh.points[self.free].ravel(), self.velocity[self.free].ravel()
        n = len(X)
        rates = lambda t, state: np.r_[state[n:], self.acceleration(state[:n])]
        found = solve_ivp(rates, (0.0, end), np.r_[X, v], "DOP853", rtol=1e-10, atol=1e-12)
        return self.at(found.y[:n, -1]).whole

    def march(self, integrator, end, steps):
        """The past after each step to a time."""
        stepper = make_stepper(self.scene(end / steps, steps), self.mesh, integrator=integrator)
        past = Start.at_rest(self.mesh.points, self.velocity).past
        for report in direct(stepper, Start(0, past), steps):
            assert report.cuts == 0
            past = advance(integrator, past, report.positions, end / steps)
            yield past

    def energy(self, past: Past):
        """Kinetic and elastic [J], above that at rest."""
        elastic = lambda x: sum(term.value(x) for term in self.problem.potential.terms)
        now = past[0]
        kinetic = 0.5 * float(self.mass @ np.sum(now.velocity**2, axis=1))
        strained = elastic(self.at(now.positions[self.free])) - elastic(self.at(self.mesh.points[self.free]))
        return kinetic + strained


@pytest.fixture(scope="module")
def oscillation():
    return Oscillation(2)


# ---- order and damping


@pytest.mark.parametrize(("integrator", "low", "high"), [(ImplicitEuler(), 0.85, 1.15), (BDF2(), 1.8, 2.2)])
def test_order_in_dt(oscillation, integrator, low, high, record_property):
    """Errors of positions at 0.6 of a period, where both phase and amplitude count."""
    end = 0.6 * 2.0 * np.pi / oscillation.omega
    exact, errors, counts = oscillation.exact(end), [], np.array([25, 50, 100, 200])
    for steps in counts:
        *_, past = oscillation.march(integrator, end, steps)
        errors.append(np.linalg.norm(past[0].positions - exact))
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    record_property("slope", float(slope))
    assert low < slope < high
    assert errors[-1] > 1e3 * TOLERANCE * end, "the solver's tolerance is part of the error"


def test_a_free_oscillation_keeps_its_energy_with_bdf2(oscillation):
    """With theta = omega dt, a mode is multiplied by rho each step: (rho - 1) / rho = i theta for implicit Euler, so
    |rho|^2 = 1 / (1 + theta^2), and (3 rho^2 - 4 rho + 1) / (2 rho^2) = i theta for BDF2, so |rho|^2 = 1 - theta^4 / 2
    + ... Its first step is one of implicit Euler. With 40 steps a period, two periods keep 14 % of the energy and 95 %.
    """
    steps, theta = 80, 2.0 * np.pi / 40
    rho = np.roots([3.0 - 2j * theta, -4.0, 1.0])
    kept = {ImplicitEuler: (1.0 + theta**2) ** -steps, BDF2: np.abs(rho).max() ** (2 * steps) / (1.0 + theta**2)}
    for integrator in (ImplicitEuler(), BDF2()):
        *_, past = oscillation.march(integrator, steps * theta / oscillation.omega, steps)
        share = oscillation.energy(past) / (0.5 * oscillation.mass @ np.sum(oscillation.velocity**2, axis=1))
        assert share == pytest.approx(kept[type(integrator)], abs=0.03)
    assert kept[ImplicitEuler] < 0.15 and kept[BDF2] > 0.94


@pytest.mark.parametrize("integrator", [ImplicitEuler(), BDF2()], ids=["implicit_euler", "bdf2"])
@pytest.mark.parametrize("d", [2, 3])
def test_free_fall(d, integrator):
    """With a constant acceleration a the velocities are exact: a step of implicit Euler gives v + a dt, and the formula
    (3 v+ - 4 v + v-) / (2 dt) = a is exact where v is linear in time.

    Positions after a step of implicit Euler are off by another a dt^2 / 2. With BDF2 the first one's error obeys
    3 e+ - 4 e + e- = 0, whose roots are 1 and 1/3: e_n = 3/4 a dt^2 (1 - 3^-n).
    """
    dt, tolerance = 0.02, 1e-8
    up = np.eye(d)[-1]
    scene = make_scene(dt=dt, steps=8, loads=(weight(d),), solver=Solver(tolerance, linear="direct"))
    mesh, v0 = block((0.0,) * d, (0.4,) * d, 2, jitter=0.1), np.linspace(1.0, 2.0, d)
    start = Start.at_rest(mesh.points, np.tile(v0, (len(mesh.points), 1)))
    past, stepper = start.past, make_stepper(scene, mesh, integrator=integrator)
    for report in direct(stepper, start, scene.steps):
        past, t, n = advance(integrator, past, report.positions, dt), report.time, report.step
        off = n / 2.0 if isinstance(integrator, ImplicitEuler) else 0.75 * (1.0 - 3.0**-n)
        # Each step leaves speeds below the tolerance, and a velocity takes 3 + 4 + 1 halves of such moves.
        np.testing.assert_allclose(past[0].velocity, np.broadcast_to(v0 - G * t * up, mesh.points.shape), atol=1e-7)
        fall = v0 * t - G * (t**2 / 2.0 + off * dt**2) * up
        np.testing.assert_allclose(report.positions, mesh.points + fall, rtol=0.0, atol=1e-8)


# ---- the past


@pytest.mark.parametrize("name", INTEGRATORS)
def test_the_past_of_a_stored_step_is_the_one_of_the_march(name, monkeypatch):
    """To the last bit, or resumed runs would be others than uninterrupted ones. After steps 2 and 3, before and after
    an impulse, it has one state.
    """
    scene = make_scene(dt=0.013, steps=8, loads=(weight(2), Impulse((0.5, 0.0), time=2.5 * 0.013)))
    mesh = block((0.0, 0.0), (0.3, 0.3), 2, jitter=0.1)
    velocity = 2.0 * (mesh.points - 0.1) ** 2
    stepper, pasts = make_stepper(scene, mesh, integrator=INTEGRATORS[name]()), []
    step = stepper.step

    def keep(number, past):
        pasts.append(past)
        return step(number, past)

    monkeypatch.setattr(stepper, "step", keep)
    reports = list(direct(stepper, Start.at_rest(mesh.points, velocity), scene.steps))
    positions, asked = [mesh.points, *(report.positions for report in reports)], []

    def stored(number):
        asked.append(number)
        return positions[number]

    for done in (0, 1, 2, 3, 4, 7):
        found = past_of(stepper.integrator, stored, velocity, done, scene.dt, anew=stepper.model.begins_anew)
        assert len(found) == len(pasts[done]) == (1 if done in (0, 2, 3) else stepper.integrator.states)
        for mine, its in zip(found, pasts[done], strict=True):
            np.testing.assert_array_equal(mine.positions, its.positions)
            np.testing.assert_array_equal(mine.velocity, its.velocity)
        assert max(asked) == done and done - min(asked) < 2 * stepper.integrator.states
        asked.clear()


# ---- steps that are cut


def test_a_cut_step_ends_by_implicit_euler_and_bdf2_goes_on(monkeypatch):
    """The third step fails once as a whole. Its halves are steps of implicit Euler, which begin with the velocity that
    BDF2 gave.
    """
    dt, tolerance = 0.01, 1e-8
    solver = Solver(tolerance=tolerance, linear="direct")
    scene = make_scene(dt=dt, steps=5, loads=(weight(2),), solver=solver)
    mesh = block((0.0, 0.0), (0.3, 0.3), 2, jitter=0.1)
    start = Start.at_rest(mesh.points, 4.0 * (mesh.points - 0.1) ** 2)
    stepper = make_stepper(scene, mesh, integrator=BDF2())
    weights = fail_solve(monkeypatch, stepper, 3)
    reports = list(direct(stepper, start, scene.steps))
    assert [report.cuts for report in reports] == [report.remedies["halvings"] for report in reports] == [0, 0, 1, 0, 0]
    whole, half = (2.0 * dt / 3.0) ** 2, (dt / 2.0) ** 2
    np.testing.assert_allclose(weights, [dt**2, whole, whole, half, half, whole, whole], rtol=1e-14)

    positions = [mesh.points, *(report.positions for report in reports)]
    now = past_of(BDF2(), positions.__getitem__, start.past[0].velocity, 2, dt)[0]
    halves = make_stepper(make_scene(dt=dt / 2.0, loads=scene.loads, solver=solver), mesh)
    middle = take_step(halves, 1, now.positions, now.velocity).positions
    end = take_step(halves, 2, middle, (middle - now.positions) / (dt / 2.0)).positions
    np.testing.assert_allclose(reports[2].positions, end, rtol=0.0, atol=10.0 * tolerance * dt)

    # From there the march is the one that sets out from these states.
    past = past_of(BDF2(), positions.__getitem__, start.past[0].velocity, 3, dt)
    resumed = list(direct(make_stepper(scene, mesh, integrator=BDF2()), Start(3, past, reports[2].record()), 5))
    for one, other in zip(resumed, reports[3:], strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)
