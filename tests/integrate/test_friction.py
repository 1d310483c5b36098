"""Friction: the slip angle on every ground and resolution, coefficients by pairs, and lagging to convergence."""

import numpy as np
import pytest

from pdvol.scene import Barrier, Friction, Gravity, NeoHookean, Solver, Support, Translation
from pdvol.solve.iteration import BALANCED, STALL
from problems import block, ground, make_scene, make_stepper, march, masses
from shapes import together

G, EPS_V, DHAT = 9.81, 1e-4, 2e-3
BLOCK = NeoHookean(young=1e6, poisson=0.3, density=1000.0)


def tilted(d, tangent):
    """Gravity on a slope of this tangent, whose coordinates lie along it."""
    angle = np.arctan(tangent)
    return Gravity((G * np.sin(angle),) + (0.0,) * (d - 2) + (-G * np.cos(angle),))


def slide(d, kind, tangent, n, steps, friction):
    """Speeds down a slope (steps,) [m/s] of a block n cells high, and the reports."""
    obstacle, geometry = ground(d, kind)
    scene = make_scene(
        (BLOCK,),
        dt=0.01,
        loads=(tilted(d, tangent),),
        obstacles=(obstacle,),
        contact=(Barrier(dhat=DHAT), friction),
        solver=Solver(tolerance=1e-7, linear="direct"),
    )
    mesh = block((0.0,) * (d - 1) + (0.88 * DHAT,), (0.2,) * (d - 1) + (0.1,), (2 * n,) * (d - 1) + (n,))
    return run(make_stepper(scene, mesh, geometry), steps)


def run(problem, steps, velocity=None):
    """Mean speeds along the first axis (steps, bodies) [m/s] and reports."""
    bodies, weights, reports = problem.space.mesh.point_bodies, masses(problem), []
    reports = list(march(problem, steps, velocity=velocity))
    parts = [np.where(bodies == b, weights, 0.0) for b in range(bodies.max() + 1)]
    return np.array([[np.average(r.velocity[:, 0], weights=m) for m in parts] for r in reports]), reports


@pytest.mark.parametrize(("d", "kind", "n"), [(2, "plane", 1), (2, "rigid", 4), (3, "plane", 1), (3, "rigid", 2)])
def test_the_slip_angle_is_within_a_per_cent_of_mu(d, kind, n):
    """mu = 1.01 tan holds, but for the creep of smoothed friction, f1(y) = 2 y - y^2 = 1 / 1.01 at y = 1 - sqrt(1 - 1 /
    1.01) of eps_v; mu = 0.99 tan slides with a = g (sin - mu cos), which implicit Euler reproduces where a is constant,
    to a thousandth of g.
    """
    tangent, steps = 0.5, 40
    held, _ = slide(d, kind, tangent, n, steps, Friction(1.01 * tangent, eps_v=EPS_V))
    # While it settles on the barrier the block slips a little; then it creeps.
    np.testing.assert_allclose(held[-3:, 0], (1.0 - np.sqrt(1.0 - 1.0 / 1.01)) * EPS_V, rtol=0.03)
    slid, reports = slide(d, kind, tangent, n, steps, Friction(0.99 * tangent, eps_v=EPS_V))
    angle = np.arctan(tangent)
    expected = G * (np.sin(angle) - 0.99 * tangent * np.cos(angle))
    assert (slid[-1, 0] - slid[-16, 0]) / (15 * 0.01) == pytest.approx(expected, rel=0.01)
    assert reports[-1].friction_residual < 1e-6  # at rest across the slope, nothing changes by lagging anew


# ---- coefficients by pairs


def two_blocks(d, kind, friction, stacked):
    """Bodies 0 and 1 beside each other on a slope of 0.5, or the second on the first, which a support holds."""
    obstacle, geometry = ground(d, kind)
    lift = 0.88 * DHAT
    first = block((0.0,) * (d - 1) + (lift,), (0.2,) * (d - 1) + (0.1,), (2,) * (d - 1) + (1,))
    low = np.r_[[0.03] * (d - 1), 0.1 + lift] if stacked else np.r_[0.4, [0.0] * (d - 2), lift]
    second = block(tuple(low), tuple(low + np.r_[[0.1] * (d - 1), 0.1]), (1,) * d)
    held = (Support(lambda X: X[:, -1] < 2 * DHAT, "body 0"),) if stacked else ()
    scene = make_scene(
        (BLOCK, BLOCK),
        dt=0.01,
        loads=(tilted(d, 0.5),),
        obstacles=(obstacle,),
        supports=held,
        contact=(Barrier(dhat=DHAT), friction),
        solver=Solver(tolerance=1e-6, linear="direct"),
    )
    return make_stepper(scene, together(first, second), geometry)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kind", ["plane", "rigid"])
def test_a_pair_has_its_own_friction_on_the_ground(d, kind):
    """Of two blocks on a slope of 0.5 that with mu = 0.8 stays, that with mu = 0.3 slides with g (sin - 0.3 cos)."""
    speeds, _ = run(
        two_blocks(d, kind, Friction(0.3, eps_v=EPS_V, pairs={("floor", "body 1"): 0.8}), stacked=False), 25
    )
    angle = np.arctan(0.5)
    assert abs(speeds[-1, 1]) < EPS_V
    assert (speeds[-1, 0] - speeds[-11, 0]) / 0.1 == pytest.approx(G * (np.sin(angle) - 0.3 * np.cos(angle)), rel=0.02)


@pytest.mark.parametrize("d", [2, 3])
def test_a_pair_of_bodies_has_its_own_friction(d):
    """The upper block slides on the held lower one as their own coefficient says, whatever that with the ground is."""
    angle = np.arctan(0.5)
    speeds, _ = run(
        two_blocks(d, "rigid", Friction(0.8, eps_v=EPS_V, pairs={("body 0", "body 1"): 0.2}), stacked=True), 16
    )
    assert (speeds[-1, 1] - speeds[-9, 1]) / 0.08 == pytest.approx(G * (np.sin(angle) - 0.2 * np.cos(angle)), rel=0.05)
    speeds, _ = run(
        two_blocks(d, "rigid", Friction(0.2, eps_v=EPS_V, pairs={("body 1", "body 0"): 0.8}), stacked=True), 16
    )
    assert abs(speeds[-1, 1]) < 0.01


# ---- lagging


@pytest.mark.parametrize(("d", "kind"), [(2, "rigid"), (3, "plane")])
def test_lagging_converges(d, kind):
    """A block pressed harder and harder while it is pushed along: forces lagged once a step are behind, iterations
    bring them up to date. In the first step, which no solve has led to, they are brought up to date in any case.
    """
    obstacle, geometry = ground(d, kind)
    press = Support(lambda X: X[:, -1] > 0.1 - 1e-9, motion=Translation((0.05,) + (0.0,) * (d - 2) + (-0.05,)))
    mesh = block((0.0,) * (d - 1) + (0.9 * DHAT,), (0.2,) * (d - 1) + (0.1,), (2,) * (d - 1) + (1,))
    residuals, counts = {}, {}
    for most, enough in ((1, 1e-2), (40, 1e-2), (40, 1e-6)):
        scene = make_scene(
            (BLOCK,),
            dt=0.01,
            obstacles=(obstacle,),
            supports=(press,),
            contact=(Barrier(dhat=DHAT), Friction(0.5, eps_v=1e-2, iterations=most, tolerance=enough)),
        )
        _, reports = run(make_stepper(scene, mesh, geometry), 4)
        residuals[most, enough] = [report.friction_residual for report in reports]
        counts[most, enough] = [report.friction_iterations for report in reports]
        assert reports[-1].record()["friction_residual"] == residuals[most, enough][-1]
    assert counts[1, 1e-2][1:] == [1] * 3 and max(residuals[1, 1e-2][1:]) > 0.05
    assert 1 < counts[1, 1e-2][0] <= STALL and residuals[1, 1e-2][0] <= BALANCED
    assert max(residuals[40, 1e-2]) <= 1e-2 and max(residuals[40, 1e-6]) <= 1e-6
    assert 1 < max(counts[40, 1e-2]) < max(counts[40, 1e-6]) < 40
