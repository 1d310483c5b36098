"""Bars that buckle. Their Hessian is indefinite on the way, and every filtered Hessian is too stiff. Lengthened steps
save most of the iterations.
"""

import numpy as np
import pytest

from pdvol.scene import Gravity, Solver, Support, Translation
from pdvol.solve import newton
from problems import block, make_scene, make_stepper, take_step


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
