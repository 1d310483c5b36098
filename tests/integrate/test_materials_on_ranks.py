"""The number of ranks changes neither what cells are made of nor what loads and damping do."""

import numpy as np
import pytest

from on_ranks import results_on
from pdvol.integrate.marches import Start, direct
from pdvol.integrate.stepper import Stepper
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import hierarchy_model
from pdvol.registry import ELEMENTS
from pdvol.scene import (
    Body,
    FixedCorotational,
    Flow,
    Force,
    Gravity,
    Impulse,
    Keyed,
    Muscle,
    NeoHookean,
    PointForce,
    Region,
    Scene,
    Solver,
    StVenantKirchhoff,
    Support,
)
from shapes import box

SAME = 1e-9  # of the unit box, over five steps with the direct solver


def scene_of(d, elements):
    """A unit box held at its left: three laws, one of them stiff, one graded and one that changes with time, damped and
    dragged, with a muscle, pushed and hit.
    """
    soft = FixedCorotational(lambda X: 1e5 * (1 + X[:, 1]), density=lambda X: 1000.0 + 500.0 * X[:, 0], damping=0.02)
    regions = (
        Region(StVenantKirchhoff(Keyed((0.0, 0.05), (3e5, 6e5))), lambda X: X[:, 0] < 0.4),
        Region(NeoHookean(1e9), lambda X: X[:, -1] > 0.7),
    )
    along, down = tuple(np.eye(d)[0]), (0.0,) * (d - 1) + (-9.81,)
    loads = (
        Gravity(lambda t: (1.0 + t) * np.array(down)),
        Flow(along, 1000.0),
        Impulse(along, 0.015, lambda X: X[:, 0] > 0.7),
        Force(lambda t: 1e3 * t * np.ones(d), lambda X: X[:, 1] > 0.5),
        PointForce(tuple(300.0 * np.eye(d)[-1]), (0.9,) * d),
    )
    return Scene(
        (Body(("coarse", "fine"), soft, regions=regions),),
        dt=0.01,
        steps=5,
        loads=loads,
        supports=(Support(lambda X: X[:, 0] < 1e-9),),
        muscles=(Muscle("body", along, 2e4, where=lambda X: X[:, 1] < 0.6),),
        elements=elements,
        solver=Solver(tolerance=1e-6, linear="direct"),
    )


def load(comm, d, elements):
    scene = scene_of(d, elements)
    hierarchy = Hierarchy([box(d, 2), box(d, 4)], comm)
    model = hierarchy_model(scene, hierarchy, 1, 1.0)
    materials, problem = model.materials, Stepper(model, hierarchy[1])
    mesh = hierarchy[1].mesh
    reports = list(direct(problem, Start.at_rest(mesh.points, np.zeros_like(mesh.points)), scene.steps))
    return {
        "young": materials.young,
        "density": materials.density,
        "law": materials.law,
        "rest": mesh.points,
        "positions": [r.positions for r in reports],
        "energies": [[r.energy[k] for k in sorted(r.energy)] for r in reports],
        "kinds": sorted(reports[0].energy),
    }


@pytest.mark.mpi
@pytest.mark.parametrize("elements", ELEMENTS)
@pytest.mark.parametrize("d", [2, 3])
def test_materials_and_loads_on_two_ranks(d, elements):
    one, two = results_on((1, 2), load, d, elements)
    for name in ("young", "density", "law"):
        np.testing.assert_array_equal(one[name], two[name])
    assert set(one["law"]) == {0, 1, 2} and one["young"].max() == 1e9
    assert all(
        np.abs(one["energies"][:, list(one["kinds"]).index(kind)]).max() > 0.0
        for kind in ("elastic", "damping", "drag", "load", "muscle")
    )
    assert np.abs(one["positions"][-1] - one["rest"]).max() > 1e-3
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=SAME)
    np.testing.assert_allclose(two["energies"], one["energies"], rtol=1e-5, atol=1e-9 * np.abs(one["energies"]).max())
