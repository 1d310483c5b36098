"""The number of ranks changes neither what cells are made of nor where bodies start, nor what loads, springs,
pulls, muscles, pressure and damping do, nor which springs break.
"""

import numpy as np
import pytest

import pdvol
from on_ranks import results_on
from pdvol.integrate.marches import Start, direct
from pdvol.integrate.stepper import Stepper
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import level_model
from pdvol.registry import ELEMENTS
from shapes import box, together

BREAKING = 800.0  # N: some of the springs break
SAME = 1e-9  # of the unit box, over five steps with the direct solver
KINDS = {"attachment", "damping", "drag", "elastic", "load", "muscle", "pressure", "pull"}


def bent(X):
    """A parabola upward from x = 2 on either side, half as wide."""
    return np.column_stack([2.0 + 0.8 * (X[:, 0] - 2.0), X[:, 1] + 0.3 * (X[:, 0] - 2.0) ** 2, *X[:, 2:].T])


def scene_of(d, elements):
    """A unit box held at its left: three laws, one of them stiff, one graded and one that changes with time, damped and
    dragged, with a muscle, pushed and hit. Springs lead to a second box, which starts bent: its modulus follows keys, a
    muscle and pressure act in it, and a support lets it go.
    """
    soft = pdvol.FixedCorotational(
        lambda X: 1e5 * (1 + X[:, 1]), density=lambda X: 1000.0 + 500.0 * X[:, 0], damping=0.02
    )
    regions = (
        pdvol.Region(pdvol.StVenantKirchhoff(pdvol.Keyed((0.0, 0.05), (3e5, 6e5))), lambda X: X[:, 0] < 0.4),
        pdvol.Region(pdvol.NeoHookean(1e9), lambda X: X[:, -1] > 0.7),
    )
    other = pdvol.NeoHookean(pdvol.Keyed((0.0, 0.1), (1e5, 5e4)), 0.4, 1000.0, damping=0.01)
    along, down = tuple(np.eye(d)[0]), (0.0,) * (d - 1) + (-9.81,)
    loads = (
        pdvol.Gravity(lambda t: (1.0 + t) * np.array(down)),
        pdvol.Flow(along, 1000.0, body="one"),
        pdvol.Impulse(along, 0.015, lambda X: X[:, 0] > 0.7, body="one"),
        pdvol.Force(lambda t: 1e3 * t * np.ones(d), lambda X: X[:, 1] > 0.5),
        pdvol.PointForce(tuple(300.0 * np.eye(d)[-1]), (0.9,) * d, body="one"),
        pdvol.Pressure("other", lambda t: 2e5 * t),
    )
    springs = {"stiffness": 1e3, "rest_length": 0.45, "breaking": BREAKING}
    waves = lambda t, X: np.maximum(0.0, np.sin(20.0 * (X[:, 0] - t)))
    return pdvol.Scene(
        (
            pdvol.Body(("coarse", "fine"), soft, regions=regions, name="one"),
            pdvol.Body(("coarse", "fine"), other, start=bent, name="other"),
        ),
        dt=0.01,
        steps=5,
        loads=loads,
        supports=(
            pdvol.Support(lambda X: X[:, 0] < 1e-9, body="one"),
            pdvol.Support(lambda X: X[:, 0] > 2.5 - 1e-9, body="other", release=0.025),
        ),
        attachments=(
            pdvol.Attachment(
                "one", "other", lambda X: X[:, 0] > 0.99, stiffness=1e3, rest_length=0.45, breaking=BREAKING
            ),
        ),
        muscles=(
            pdvol.Muscle("one", along, 2e4, where=lambda X: X[:, 1] < 0.6),
            pdvol.Muscle("other", along, 4e4, waves),
        ),
        pulls=(pdvol.Pull("one", (1.0,) * d, (0.0, 0.1), [(1.0,) * d, (1.5,) * d], 1e4),),
        elements=elements,
        solver=pdvol.Solver(tolerance=1e-6, linear="direct"),
    )


def load(comm, d, elements):
    scene = scene_of(d, elements)
    hierarchy = Hierarchy([together(box(d, n), box(d, n, 1.5, 2.5)) for n in (2, 4)], comm)
    model = level_model(scene, hierarchy, 1, 1.0)
    materials = model.materials
    reports = list(direct(Stepper(model, hierarchy[1]), Start.at_rest(model.start, model.velocity), scene.steps))
    return {
        "young": materials.young,
        "density": materials.density,
        "law": materials.law,
        "start": model.start,
        "positions": [r.positions for r in reports],
        "energies": [[r.energy[k] for k in sorted(r.energy)] for r in reports],
        "kinds": sorted(reports[0].energy),
        "broken": [len(r.terms.get("attachment", {}).get("broken", ())) for r in reports],
    }


@pytest.mark.mpi
@pytest.mark.parametrize("elements", ELEMENTS)
@pytest.mark.parametrize("d", [2, 3])
def test_one_rank_and_two_move_alike(d, elements):
    one, two = results_on((1, 2), load, d, elements)
    assert 0 < one["broken"].max() < 8
    for name in ("young", "density", "law", "broken"):
        np.testing.assert_array_equal(one[name], two[name])
    assert set(one["law"]) == {0, 1, 2} and one["young"].max() == 1e9
    assert {kind for kind, energy in zip(one["kinds"], one["energies"].T, strict=True) if energy.any()} >= KINDS
    assert np.abs(one["positions"][-1] - one["start"]).max() > 1e-3
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=SAME)
    np.testing.assert_allclose(two["energies"], one["energies"], rtol=1e-5, atol=1e-9 * np.abs(one["energies"]).max())
