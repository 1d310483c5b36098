"""Motions and equilibria with answers derived by hand, and what every solve must keep."""

import numpy as np
import pytest

from pdvol.integrate.stepper import Stepper
from pdvol.potentials.potential import Positions
from pdvol.scene import Barrier, FixedCorotational, Friction, NeoHookean, Solver, StVenantKirchhoff, Support
from problems import block, ground, make_scene, make_stepper, march, weight
from shapes import box, together

G = 9.81


def top(X):
    return X[:, -1] > X[:, -1].max() - 1e-9


def left(X):
    return X[:, 0] < 1e-9


# ---- equilibria: one step so long that inertia, (period / step)^2 of the load, does not matter


def equilibrium(material, mesh, where, seconds, nearest):
    """Displacements (n, d) under gravity along the last axis, to `nearest` [m], after a step of `seconds` >> the
    slowest period.
    """
    scene = make_scene(
        (material,),
        dt=seconds,
        loads=(weight(mesh.dim),),
        supports=(Support(where),),
        solver=Solver(tolerance=nearest / seconds, linear="direct"),
    )
    (report,) = march(make_stepper(scene, mesh), 1)
    assert report.cuts == 0
    return report.positions - mesh.points


@pytest.mark.parametrize("d", [2, 3])
def test_hanging_bar(d):
    r"""A bar of length L hanging from its top without Poisson's effect: stress rho g z at height z above the tip.

    psi = mu/2 (F^2 - 1 - 2 ln F) with 2 mu = E, so P = E/2 (F - 1/F) = E (e - e^2/2 + ...), F = 1 + e, and e = s +
    s^2/2 with s = rho g z / E: the tip sinks by L (a/2 + a^2/6), a = rho g L / E. Means over horizontal sections obey
    the one-dimensional elements, which are exact at nodes: the integral of du/dz over a layer is the difference of u's
    over its two faces, and the sum of a row's hat functions depends on z alone. The lumps of weight at the corners bend
    the bar by some per cent, which the mean feels as a^2 only.
    """
    L, material = 1.0, NeoHookean(young=1e8, poisson=0.0, density=1000.0)
    mesh = block((0.0,) * d, (0.2,) * (d - 1) + (L,), (2,) * (d - 1) + (8,))
    a = material.density * G * L / material.young  # about 1e-4
    period = 4.0 * L * np.sqrt(material.density / material.young)
    u = equilibrium(material, mesh, top, 1e4 * period, 1e-10)[:, -1]
    facets = mesh.boundary[np.all(mesh.points[mesh.boundary, -1] < 1e-9, axis=1)]  # of equal size
    np.testing.assert_allclose(u[facets].mean(), -L * (a / 2 + a**2 / 6), rtol=1e-5)


def test_cantilever():
    """A beam clamped at one end sags at its tip by q L^4 / (8 E' I) + q L^2 / (2 k G A) (Timoshenko), q = rho g h.

    Plane strain: E' = E / (1 - nu^2), I = h^3 / 12, A = h, k = 5/6. Linear triangles lock in bending with an error of
    order (size / h)^2, which is extrapolated away from meshes of 8 and 16 across; the next order, and the clamp, which
    holds Poisson's widening back over about h / 2 of the beam, leave less than a per cent.
    """
    L, h, material = 1.0, 0.1, NeoHookean(young=1e9, poisson=0.3, density=1000.0)
    q, stiff, inertia = material.density * G * h, material.young / (1.0 - material.poisson**2), h**3 / 12.0
    expected = q * L**4 / (8.0 * stiff * inertia) + q * L**2 / (2.0 * 5.0 / 6.0 * material.mu * h)
    assert expected < 0.02 * h  # small: linear theory holds
    sags = {}
    for across in (4, 8, 16):
        mesh = block((0.0, 0.0), (L, h), (10 * across, across))
        u = equilibrium(material, mesh, left, 100.0, 1e-9)
        sags[across] = -u[mesh.points[:, 0] > L - 1e-9, 1].mean()
    # Locked meshes are too stiff; the error falls by nearly four per halving.
    errors = {n: 1.0 - w / expected for n, w in sags.items()}
    assert 0.0 < errors[16] < errors[8] < errors[4]
    assert np.log2((sags[8] - sags[4]) / (sags[16] - sags[8])) > 1.5
    assert (4.0 * sags[16] - sags[8]) / 3.0 == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("d", "law"), [(2, StVenantKirchhoff), (2, FixedCorotational), (3, NeoHookean)])
def test_a_rigid_block_thrown_on_a_soft_one(d, law):
    """It sinks in and keeps its shape: strains of a stress of about rho g h, 2e3 Pa, over 2e10 Pa, ten thousand times
    those of the soft one.
    """
    soft = block((0.0,) * (d - 1) + (0.005,), (0.6,) * (d - 1) + (0.205,), (4,) * (d - 1) + (2,), jitter=0.05)
    hard = block((0.2,) * (d - 1) + (0.215,), (0.4,) * (d - 1) + (0.415,), 2, jitter=0.05, seed=1)
    mesh = together(soft, hard)
    scene = make_scene(
        (law(2e4), law(2e10)),
        loads=(weight(d),),
        obstacles=ground(d)[:1],
        contact=(Barrier(dhat=4e-3), Friction(0.3)),
        solver=Solver(tolerance=1e-3),
    )
    thrown = mesh.point_bodies == 1
    velocity = np.where(thrown[:, None], [0.5] + [0.0] * (d - 2) + [-1.0], 0.0)
    for report in march(make_stepper(scene, mesh), 15, velocity=velocity):
        assert report.cuts == 0 and report.newton_iterations < 60
    x = report.positions
    assert report.contacts > 0 and x[thrown, -1].min() < 0.2
    strains = []
    for body in (soft, hard):
        mine = x[thrown] if body is hard else x[~thrown]
        F = np.einsum("kia,kij->kaj", mine[body.cells], body.hat_gradients)
        strains.append(np.abs(np.einsum("kai,kaj->kij", F, F) - np.eye(d)).max() / 2)
    assert strains[0] > 0.05 and strains[1] < 1e-5


# ---- what every solve keeps


def watched(problem: Stepper):
    """The potential's values at Newton's iterates, one list per solve, and the reports of all solves."""
    solves, reports = [], []

    def monitor(snes, iteration, norm):
        if iteration == 0:
            solves.append([])
        rows = snes.getSolution().getArray(readonly=True).reshape(-1, problem.space.dim)
        solves[-1].append(problem.potential.value(Positions(problem.space, rows.copy())))

    problem.newton.snes.setMonitor(monitor)
    solve = problem.newton.solve

    def keep(x, *choices, **more):
        x, report = solve(x, *choices, **more)
        reports.append(report)
        return x, report

    problem.newton.solve = keep
    return solves, reports


@pytest.mark.parametrize("d", [2, 3])
def test_newton_goes_downhill_and_stops_slow(d):
    """A skewed block thrown at a plane: every iterate's potential is below the one before, to round-off; speeds end
    within the tolerance.
    """
    tolerance = 1e-5
    scene = make_scene(
        dt=0.02,
        loads=(weight(d),),
        obstacles=ground(d)[:1],
        contact=(Barrier(dhat=0.01), Friction(0.3)),
        solver=Solver(tolerance=tolerance, linear="direct"),
    )
    mesh = block((0.0,) * (d - 1) + (0.02,), (0.4,) * (d - 1) + (0.42,), 2, jitter=0.1)
    problem = make_stepper(scene, mesh)
    solves, reports = watched(problem)
    velocity = np.tile(np.r_[1.0, np.zeros(d - 2), -4.0], (len(mesh.points), 1)) + 5.0 * (mesh.points - 0.2) ** 2
    assert max(report.contacts for report in march(problem, 12, velocity=velocity)) > 0
    assert max(len(energies) for energies in solves) > 3
    for energies in solves:
        energies = np.array(energies)
        assert np.all(np.isfinite(energies))
        assert np.all(np.diff(energies) <= 1e-12 * np.abs(energies).max())
    assert len(reports) >= 12
    assert all(report.converged for report in reports)
    assert all(report.speed <= tolerance for report in reports if report.reason != "ROUNDING")
    assert sum(report.reason == "ROUNDING" for report in reports) <= 1


@pytest.mark.parametrize("d", [2, 3])
def test_a_tolerance_below_rounding_ends_the_solve(d):
    """Where the energy cannot fall any further in double precision a solve ends; it neither runs out of iterations nor
    cuts the step.
    """
    mesh = box(d, 2, jitter=0.1)
    problem = make_stepper(
        make_scene(dt=0.01, solver=Solver(tolerance=1e-16, linear="direct", max_iterations=60)), mesh
    )
    for report in march(problem, 4, velocity=4.0 * (mesh.points - 0.3) ** 2):
        assert report.cuts == 0
        assert report.newton_iterations < 30
