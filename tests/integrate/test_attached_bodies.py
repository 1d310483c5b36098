"""Bodies on springs: periods and breaking worked out by hand."""

import numpy as np
import pytest

from pdvol.integrate.marches import Start, direct
from pdvol.registry import INTEGRATORS
from pdvol.scene import Attachment, NeoHookean, Solver
from problems import block, make_scene, make_stepper
from shapes import together

STIFF = NeoHookean(1e9, 0.3, 1000.0)
GAP, K, DT, STEPS = 0.1, 2000.0, 0.01, 40
MASS = 1000.0 * 0.2 * 0.1  # kg of each block, per metre of depth
OMEGA2 = K / (MASS / 2)  # 1/s^2: two masses on a spring have the reduced mass m/2


def by_hand(integrator, first, speed, most):
    """e'' = -omega^2 e by the integrator's formula; the first step is implicit Euler's. The spring breaks at the end of
    a step with e > `most`.

    Returns e after each step, and how many steps the spring bore.
    """
    e, v, omega2, bore = [first], [speed], OMEGA2, STEPS
    for number in range(1, STEPS + 1):
        second = integrator == "bdf2" and number > 1
        h = 2.0 * DT / 3.0 if second else DT
        reached = (4.0 * e[-1] - e[-2] + h * (4.0 * v[-1] - v[-2])) / 3.0 if second else e[-1] + DT * v[-1]
        e.append(reached / (1.0 + omega2 * h**2))
        v.append((3.0 * e[-1] - 4.0 * e[-2] + e[-3]) / (2.0 * DT) if second else (e[-1] - e[-2]) / DT)
        if omega2 and e[-1] > most:
            omega2, bore = 0.0, number
    return np.array(e[1:]), bore


@pytest.mark.parametrize(("first", "speed", "force"), [(0.02, 0.0, np.inf), (0.0, 1.0, 100.0)])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_two_blocks_swing_as_the_integrator_s_formula_says_until_springs_break(integrator, first, speed, force):
    """Springs that are pulled by less than their length never get to no length, where their direction would turn. With
    1 m/s the first step past the force K e is known, and nothing acts from then on.
    """
    mesh = together(block((0.0, 0.0), (0.2, 0.1), 2), block((0.2 + GAP, 0.0), (0.4 + GAP, 0.1), 2))
    breaking = None if force == np.inf else force
    springs = Attachment(
        "body 0", "body 1", lambda X: X[:, 0] > 0.199, stiffness=K, rest_length=GAP - first, breaking=breaking
    )
    scene = make_scene((STIFF, STIFF), dt=DT, attachments=(springs,), solver=Solver(1e-7, linear="direct"))
    stepper = make_stepper(scene, mesh, integrator=INTEGRATORS[integrator]())
    start = Start.at_rest(mesh.points, speed * np.outer(mesh.point_bodies == 1, (1.0, 0.0)))
    reports = list(direct(stepper, start, STEPS))
    apart = [np.subtract(*(r.positions[mesh.point_bodies == i, 0].mean() for i in (1, 0))) for r in reports]
    expected, bore = by_hand(integrator, first, speed, force / K)
    np.testing.assert_allclose(np.array(apart) - 0.2 - (GAP - first), expected, atol=2e-5)
    assert 2 < bore < 20 or force == np.inf
    for number, report in enumerate(reports, 1):  # a spring for each of the two facets
        assert report.terms == ({} if number < bore or force == np.inf else {"attachment": {"broken": [0, 1]}})
        assert (report.energy["attachment"] > 0.0) == (number <= bore)
