"""Marches: levels of equal meshes, what a level adds to the one below it, and scenes side by side."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.integrate.integrator import past_of
from pdvol.integrate.marches import Start, direct, mean_of_forces, progressive
from pdvol.integrate.stepper import Stepper
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import level_model
from pdvol.levels.obstacles import placed_obstacles
from pdvol.potentials.build import build_terms
from pdvol.potentials.potential import Positions
from pdvol.registry import INTEGRATORS
from pdvol.scene import Barrier, Friction, NeoHookean, Plane, Rigid, Solver
from problems import SOFT, block, make_scene, make_stepper, spike, weight


def falling(d, tolerance, steps, contact=True):
    """A block with sideways speed falls on a spike and a plane: scene, mesh, the spike, and the initial velocity."""
    low, size = 0.02, 0.3
    mesh = block((0.0,) * (d - 1) + (low,), (size,) * (d - 1) + (low + size,), 2, jitter=0.1, seed=4)
    plane = Plane((0.0,) * d, tuple(np.eye(d)[-1]))
    bottom = mesh.points[:, -1].min()
    tip = np.r_[[0.16, 0.13][: d - 1], bottom - 0.01]
    physics = {"obstacles": (plane, Rigid("spike")), "contact": (Barrier(dhat=0.008), Friction(0.3, eps_v=0.01))}
    scene = make_scene(
        (SOFT,),
        steps=steps,
        loads=(weight(d),),
        solver=Solver(tolerance=tolerance, linear="direct"),
        **(physics if contact else {}),
    )
    velocity = np.tile(np.r_[0.4, np.zeros(d - 2), -1.0], (len(mesh.points), 1)) + 2.0 * (mesh.points - 0.1) ** 2
    return scene, mesh, (spike(tip),) if contact else (), velocity


# ---- levels


@pytest.mark.parametrize("name", INTEGRATORS)
@pytest.mark.parametrize("d", [2, 3])
def test_progressive_on_the_same_mesh_repeats_direct(d, name):
    """P = 1: x_hat = x + (x_hat_c - x_c) is the level's own as long as both levels are the same, which induction and
    the solver keep. Where forces are means of several steps, that holds while they are constant: in free fall.
    """
    tolerance, touches = 1e-5, INTEGRATORS[name]().states == 1
    scene, mesh, obstacles, velocity = falling(d, tolerance, 10, contact=touches)
    velocity = velocity if touches else np.full_like(velocity, 0.4)
    levels = Hierarchy([mesh, mesh], MPI.COMM_WORLD)
    prolongation = levels.prolongation(1)
    assert abs(prolongation.weights() - np.eye(len(mesh.points))).max() < 1e-12
    integrator = INTEGRATORS[name]()
    placed = placed_obstacles(scene.obstacles, obstacles)
    problems = [Stepper(level_model(scene, levels, i, 1.0, placed), levels[i], integrator=integrator) for i in range(2)]
    coarse = list(direct(problems[0], Start.at_rest(mesh.points, velocity), scene.steps))
    places = [mesh.points, *(report.positions for report in coarse)]
    below = lambda step: past_of(integrator, places.__getitem__, velocity, step, scene.dt)
    fine = list(progressive(problems[1], prolongation, below, Start.at_rest(mesh.points, velocity), scene.steps))
    assert [report.step for report in fine] == list(range(1, scene.steps + 1))
    assert (max(report.contacts for report in coarse) > 0) == touches
    for a, b in zip(coarse, fine, strict=True):
        # Each step starts from the other level's last place, give or take what the solver left: tolerance times dt a
        # step.
        np.testing.assert_allclose(b.positions, a.positions, atol=a.step * tolerance * scene.dt)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_level_amplifies_no_frequency(name):
    """Of a motion exp(i theta t): VelPro repeats the steps of the level below. BDF2's own prediction is 1 - b of them,
    with b = (3 - z)^2 (1 - z) / 9 and z = exp(-i theta), 23/9 at the highest frequency. The mean of forces makes it
    1 - b (2 + 2 z + z^2 - z^4) / 4.
    """
    integrator, gains, euler = INTEGRATORS[name](), [], name == "implicit_euler"
    for theta in np.linspace(0.0, np.pi, 181)[1:]:
        path = np.exp(1j * theta * np.arange(12)).view(float).reshape(-1, 1, 2)
        coarse = lambda step, path=path: past_of(integrator, path.__getitem__, np.zeros((1, 2)), step, 0.1)
        plain = integrator.predict(coarse(10), 0.1) - path[10]
        change, z = mean_of_forces(integrator, coarse, 11, 0.1), np.exp(-1j * theta)
        gains.append([np.linalg.norm(each) / abs(1.0 - z) for each in (plain, plain + (0.0 if euler else change))])
        b, mean = (3.0 - z) ** 2 * (1.0 - z) / 9.0, (2.0 + 2.0 * z + z**2 - z**4) / 4.0
        assert gains[-1] == pytest.approx([1.0, 1.0] if euler else np.abs([1.0 - b, 1.0 - b * mean]), abs=1e-11)
    assert np.max(gains, axis=0) == pytest.approx([1.0, 1.0] if euler else [23 / 9, 1.0524], abs=1e-4)


def test_the_mean_of_forces_keeps_each_impulse():
    """Whatever the motion, all that the mean has changed is a part of the last forces, also where forces jump."""
    integrator, rng, jump, last = INTEGRATORS["bdf2"](), np.random.default_rng(5), 17, 39
    path = np.cumsum(rng.standard_normal((last + 1, 1, 2)), axis=0)
    coarse = lambda step: past_of(integrator, path.__getitem__, np.zeros((1, 2)), step, 0.1, anew=lambda n: n == jump)
    weights = [integrator.weight(coarse(n), 0.1) for n in range(last)]
    forces = [(integrator.predict(coarse(n), 0.1) - path[n + 1]) / weight for n, weight in enumerate(weights)]
    changes = [mean_of_forces(integrator, coarse, n + 1, 0.1) for n in range(last)]
    total = sum(change / w for change, w in zip(changes, weights, strict=True) if change is not None)
    left = lambda f: 0.25 * (f[-3] + f[-4]) - 0.5 * f[-1]
    np.testing.assert_allclose(total, left(forces[:jump]) + left(forces), atol=1e-11)
    assert [n for n, change in enumerate(changes) if change is None] == [0, jump]


def test_a_level_is_the_sum_of_what_steps_have_added():
    """The lemmas of the paper's appendix B for two levels: x_1^{t+1} = x_1^1 + P (x_0^t - x_0^0) + the sum of what the
    steps after the first have added to their predictions, gamma = -dt^2 M^-1 grad E, with forces from terms made anew.
    """
    scene, fine, _, velocity = falling(2, 1e-8, 8, contact=False)
    coarse = block((0.0, 0.02), (0.3, 0.32), 1)
    levels, integrator = Hierarchy([coarse, fine], MPI.COMM_WORLD), INTEGRATORS["implicit_euler"]()
    problems = [Stepper(level_model(scene, levels, i, 1.0), levels[i], integrator=integrator) for i in range(2)]
    thrown = np.tile([0.4, -1.0], (len(coarse.points), 1)) + 2.0 * (coarse.points - 0.1) ** 2
    below = [coarse.points]
    below += [report.positions for report in direct(problems[0], Start.at_rest(coarse.points, thrown), scene.steps)]
    past = lambda step: past_of(integrator, below.__getitem__, thrown, step, scene.dt)
    start = Start.at_rest(fine.points, velocity)
    places = [report.positions for report in progressive(problems[1], levels.prolongation(1), past, start, scene.steps)]
    space, added = levels[1], np.zeros_like(fine.points)
    for n, place in enumerate(places[1:], 1):
        terms = build_terms(level_model(scene, levels, 1, 1.0), space)
        begin, end = (Positions(space, space.from_input(x)) for x in (places[n - 1], place))
        for term in terms.potentials:
            term.begin_step(begin, n * scene.dt, (n + 1) * scene.dt)
            added -= scene.dt**2 * space.to_input(term.gradient(end) / terms.mass)
    expected = places[0] + levels.prolongation(1).prolong(below[-2] - below[0]) + added
    assert np.abs(added).max() > 1e-3, "forces have moved it"
    np.testing.assert_allclose(places[-1], expected, atol=scene.steps * 1e-8 * scene.dt)


# ---- processes


@pytest.mark.parametrize("d", [2, 3])
def test_two_scenes_in_one_process_agree_with_each_alone(d):
    first, mesh, spikes, velocity = falling(d, 1e-4, 8)
    stiff, solver = NeoHookean(5e5, 0.2, 500.0), Solver(tolerance=1e-3, linear="iterative", petsc="-ksp_rtol 1e-8")
    second = replace(first, bodies=(replace(first.bodies[0], material=stiff),), dt=0.02, solver=solver)
    begin = lambda scene, speed: direct(make_stepper(scene, mesh, spikes), Start.at_rest(mesh.points, speed), 8)
    alone = [list(begin(first, velocity)), list(begin(second, 0.5 * velocity))]
    together = zip(begin(first, velocity), begin(second, 0.5 * velocity), strict=True)
    for single, both in zip(zip(*alone, strict=True), together, strict=True):
        for a, b in zip(single, both, strict=True):
            np.testing.assert_array_equal(a.positions, b.positions)
            for name in ("newton_iterations", "contacts", "linear_solver"):
                assert getattr(a, name) == getattr(b, name)
