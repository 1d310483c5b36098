"""Bodies between what moves and what stands: fingers, a fist that kneads dough, a hammer, a ring that closes."""

import numpy as np
import pytest

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Path, Placement, Plane, Rigid, Scene
from pdvol.meshes import ball, bar, box, cylinder, torus

UP = (0.0, 1.0, 0.0)


def shot(shape, young, at, mu, steps, *movers, vertices=150, dt=0.01):
    body = Body(shape, NeoHookean(young, 0.45), (vertices,), name="body", placement=Placement((0.0, at, 0.0)))
    around, pull = (Plane((0.0, 0.0, 0.0), UP, name="floor"), *movers), Gravity((0.0, -9.81, 0.0))
    return Scene((body,), obstacles=around, loads=(pull,), contact=(Barrier(), Friction(mu)), dt=dt, steps=steps)


def pinch():
    def finger(side):
        along = Path((0.0, 0.3, 0.8), [(0.0, 0.0, 0.0), (-0.075 * side, 0.0, 0.0), (-0.075 * side, 0.4, 0.0)])
        return Rigid(box((0.05, 0.12, 0.1)), Placement((0.16 * side, 0.1, 0.0)), along, f"finger {side}")

    return shot(ball(0.1), 2e4, 0.101, 0.8, 85, finger(-1), finger(1))


def knead():
    t = np.linspace(0.0, 1.2, 49)
    down = -0.07 * (1.0 - np.cos(2.0 * np.pi * t)) - 0.04 * np.minimum(t, 1.0)
    along = Path(tuple(t), tuple(zip(0.05 * np.sin(np.pi * t), down, 0.0 * t, strict=True)))
    return shot(ball(0.2), 5e3, 0.203, 0.5, 120, Rigid(ball(0.1), Placement((0.0, 0.51, 0.0)), along, "fist"))


def hammer():
    blows = [(0.3 * k + 0.1 * i, (0.04 * k - 0.1, -0.26 * (i == 1), 0.0)) for k in range(3) for i in range(3)]
    face = Rigid(cylinder(0.07, 0.15, 24), Placement((0.0, 0.38, 0.0)), Path(*zip(*blows, strict=True)), "hammer")
    return shot(box((0.4, 0.1, 0.4)), 2e4, 0.051, 0.5, 90, face)


def clasp():
    ring = torus(0.22, 0.05, 24, 8)
    frames = np.array([ring.vertices * (size, 1.0, size) + [0.0, 0.15, 0.0] for size in (1.0, 0.6)])
    closing = pdvol.PointCache(frames, times=(0.0, 0.5), faces=ring.triangles)
    return shot(ball(0.15), 2e4, 0.153, 0.5, 50, pdvol.Deforming(closing, name="ring"))


@pytest.mark.parametrize("squeeze", [pinch, knead, hammer, clasp])
def test_no_step_is_long_and_nothing_waits(squeeze):
    scene = squeeze()
    steps = list(pdvol.march(scene))
    iterations = [step.report.newton_iterations for step in steps]
    assert len(steps) == scene.steps and np.mean(iterations) <= 15 and max(iterations) <= 60
    assert max(step.report.behind for step in steps) == 0.0
    assert steps[-1].positions[:, 1].min() > (0.3 if squeeze is pinch else 0.0)


@pytest.mark.parametrize(("young", "gap", "most"), [(1e5, 2e-3, 12), (1e5, 3e-3, 12), (5e6, 3e-3, 16)])
def test_a_bar_that_lands_flat_takes_few_iterations(young, gap, most):
    scene = shot(bar(0.8, 0.1, 0.1, 0.05), young, 0.05 + gap, 0.0, 3, vertices=400, dt=0.02)
    reports = [step.report for step in pdvol.march(scene)]
    assert reports[0].contacts > 50 and max(report.newton_iterations for report in reports) <= most
