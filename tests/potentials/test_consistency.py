"""The pull towards a coarser level: its energy and Hessian by hand, and that its weight stands beside the inertia's
1/2.
"""

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.levels.space import LevelSpace
from pdvol.potentials.build import Terms
from pdvol.potentials.consistency import Consistency, Guide
from pdvol.potentials.loads import assemble_mass
from pdvol.potentials.potential import Positions
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.report import Stopwatch
from shapes import box, together
from taylor import hessian_of

DENSITIES = np.array([2.0, 5.0])
DT, WEIGHT = 0.02, 0.3


@pytest.fixture(scope="module", params=[2, 3])
def held(request):
    """A guided term on two bodies, its space, masses and random targets, in a step from 3 dt to 4 dt."""
    d = request.param
    space = LevelSpace(together(box(d, 2, jitter=0.1), box(d, 1, 2.0, 3.0)), MPI.COMM_SELF)
    target = np.random.default_rng(1).normal(size=space.mesh.points.shape)
    asked = []
    term = Consistency(
        space,
        assemble_mass(space, DENSITIES[space.mesh.bodies]),
        Guide(WEIGHT / DT**2, lambda time: asked.append(time) or target),
    )
    term.begin_step(Positions(space, space.from_input(space.mesh.points)), 3 * DT, 4 * DT)
    assert asked == [4 * DT]
    return term, space, assemble_mass(space, DENSITIES[space.mesh.bodies]), space.from_input(target)


def test_by_hand(held):
    """E = k sum m |x - target|^2 and its Hessian 2 k M, whatever filter is asked for."""
    term, space, mass, target = held
    x, k = space.from_input(space.mesh.points), WEIGHT / DT**2
    assert term.value(Positions(space, target)) == 0.0
    assert term.value(Positions(space, x)) == pytest.approx(
        k * np.sum(mass[:, 0] * ((x - target) ** 2).sum(axis=1)), rel=1e-13
    )
    for positive in ("none", "clamp", "abs"):
        np.testing.assert_allclose(
            hessian_of(term, space, x, positive).toarray(), np.diag(2.0 * k * mass.ravel()), rtol=1e-15
        )


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_the_weight_stands_beside_the_inertia_s_half(held, share):
    """1/2 |x - x_hat|^2 + w |x - target|^2 is least at (x_hat + 2 w target) / (1 + 2 w); in a cut step w counts by the
    square of its share.
    """
    term, space, mass, target = held
    potential = IncrementalPotential(space, Terms(mass, (term,)), Stopwatch())
    x_hat = np.random.default_rng(2).normal(size=mass.shape)
    potential.begin_step(Positions(space, x_hat), x_hat, (share * DT) ** 2, 4 * DT - share * DT, 4 * DT)
    w = WEIGHT * share**2
    least = Positions(space, (x_hat + 2 * w * target) / (1 + 2 * w))
    assert np.abs(potential.gradient(least)).max() < 1e-13 * mass.max()
    assert np.abs(potential.gradient(Positions(space, x_hat))).max() > 1e-3 * mass.max()
    # |x_hat - target|_M^2 times 1/2 (2w / (1 + 2w))^2 + w / (1 + 2w)^2 = w / (1 + 2w).
    assert potential.value(least) == pytest.approx(w / (1 + 2 * w) * np.sum(mass * (x_hat - target) ** 2), rel=1e-12)
    assert potential.energies(least)["consistency"] == pytest.approx(
        WEIGHT / DT**2 * np.sum(mass * (least.owned - target) ** 2), rel=1e-12
    )
