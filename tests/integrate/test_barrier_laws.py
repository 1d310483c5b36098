"""A block at rest: gap and pressure converge as the mesh is refined."""

import numpy as np
import pytest
from scipy.optimize import brentq

import barrier_law
from pdvol.geometry.level_mesh import boundary_areas
from pdvol.scene import Barrier, NeoHookean, Solver
from problems import block, ground, make_scene, make_stepper, march, weight

G, DHAT, SIDE = 9.81, 2e-3, 0.2
SOFT = NeoHookean(young=1e5, poisson=0.3, density=1000.0)
WEIGHT = SOFT.density * G * SIDE  # [Pa]


def rest(d, n):
    """A cube of n cells a side after it came to rest on a plane, from 0.9 dhat above: gaps [m] and areas of its
    lower side's vertices.
    """
    scene = make_scene(
        (SOFT,),
        dt=0.02,
        loads=(weight(d),),
        obstacles=ground(d)[:1],
        contact=(Barrier(dhat=DHAT),),
        solver=Solver(tolerance=1e-6, linear="direct"),
    )
    lift = 0.9 * DHAT
    mesh = block((0.0,) * (d - 1) + (lift,), (SIDE,) * (d - 1) + (SIDE + lift,), n)
    reports = list(march(make_stepper(scene, mesh), 40))
    x = reports[-1].positions
    assert np.abs(reports[-1].velocity).max() < 1e-3
    low = mesh.points[:, -1] < lift + 1e-9
    facets = mesh.boundary[low[mesh.boundary].all(axis=1)]  # corners' sides do not press
    assert boundary_areas(mesh)[low].min() > 0.0
    areas = np.bincount(facets.ravel(), minlength=len(low))[low] * SIDE ** (d - 1) / facets.size
    return x[low, -1], areas


def pressures(gaps):
    return barrier_law.pressure((gaps / DHAT) ** 2, DHAT, Barrier().stiffness * SOFT.young)


@pytest.mark.parametrize(("d", "sizes"), [(2, (2, 4, 8, 16)), (3, (1, 2, 4))])
def test_gap_and_pressure_converge(d, sizes):
    """The pressure below a resting block is its weight over its area, rho g h (uniaxial stress is exact), and the gap
    the barrier's at it.

    A vertex at the lower rim carries half of its area on the sides, too, so that the rim presses more: an error of
    first order in the mesh.
    """
    expected = DHAT * brentq(lambda y: pressures(y * DHAT) - WEIGHT, 1e-3, 1.0 - 1e-9)
    gap_errors, pressure_errors = [], []
    for n in sizes:
        gaps, areas = rest(d, n)
        gap_errors.append(abs(np.average(gaps, weights=areas) - expected) / DHAT)
        pressure_errors.append(abs(np.average(pressures(gaps), weights=areas) / WEIGHT - 1.0))
    for errors in (gap_errors, pressure_errors):
        assert np.all(np.diff(errors) < 0.0), errors
        assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] < -0.7, errors
    assert gap_errors[-1] < (0.01 if d == 2 else 0.02) and pressure_errors[-1] < (0.1 if d == 2 else 0.4), (
        gap_errors,
        pressure_errors,
    )
