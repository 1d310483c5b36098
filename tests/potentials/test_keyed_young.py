"""A Young's modulus that follows keys in time: energies are those of the material of each time, nothing is compiled
again.
"""

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.materials import cell_materials, level_materials
from pdvol.levels.space import LevelSpace
from pdvol.potentials.elasticity import CauchyStress
from pdvol.potentials.potential import Positions
from pdvol.scene import Body, FixedCorotational, Keyed, NeoHookean, Pressure, Region, Scene, StVenantKirchhoff
from problems import elastic, make_scene
from shapes import box, together
from taylor import hessian_of, state

DIMENSIONS = [2, 3]
KEYS = Keyed((1.0, 3.0), (2.0, 6.0))
SECOND = 5.0  # Pa: Young's modulus of the other body


@pytest.mark.parametrize(
    ("d", "law", "elements"),
    [(2, StVenantKirchhoff, "linear"), (2, FixedCorotational, "smoothed"), (3, NeoHookean, "smoothed")],
)
def test_each_time_has_its_own_material(d, law, elements):
    """Value, gradient, Hessian and stress at t = 2.5 s are those of 5 Pa in one body, and of the other's own."""
    space = LevelSpace(together(box(d, 2, jitter=0.1), box(d, 1, 2.0, 3.0)), MPI.COMM_SELF)
    keyed, *_ = elastic(space, law(KEYS, 0.3), law(SECOND, 0.3), elements=elements)
    fixed, *_ = elastic(space, law(5.0, 0.3), law(SECOND, 0.3), elements=elements)
    x = state(space)
    at = Positions(space, x)
    early = keyed.value(at)
    keyed.begin_step(at, 2.4, 2.5)
    assert keyed.value(at) == pytest.approx(fixed.value(at), rel=1e-13) and keyed.value(at) > 1.2 * early
    np.testing.assert_allclose(keyed.gradient(at), fixed.gradient(at), rtol=1e-11, atol=1e-13)
    for projection in ("none", "clamp"):
        one, other = (hessian_of(term, space, x, projection).toarray() for term in (keyed, fixed))
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-12)
    stresses = [np.zeros((len(space.mesh.cells), 3, 3)) for _ in range(3)]
    measured = CauchyStress(keyed)
    for time, into in ((2.5, stresses[0]), (0.0, stresses[1])):
        keyed.set_time(time)
        measured.add_to(into, space.to_input(x))
    CauchyStress(fixed).add_to(stresses[2], space.to_input(x))
    np.testing.assert_allclose(stresses[0], stresses[2], rtol=1e-11, atol=1e-13)
    mine = space.mesh.bodies == 0
    np.testing.assert_allclose(stresses[0][mine], 2.5 * stresses[1][mine], rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_damping_follows_too(d):
    """Damping is stress over strain rate by stress over strain: it scales with Young's modulus."""
    space = LevelSpace(box(d, 2, jitter=0.1), MPI.COMM_SELF)
    _, keyed = elastic(space, NeoHookean(KEYS, 0.3, damping=0.1))
    _, fixed = elastic(space, NeoHookean(6.0, 0.3, damping=0.1))
    x_t, x = Positions(space, space.from_input(space.mesh.points)), Positions(space, state(space))
    for term in (keyed, fixed):
        term.begin_step(x_t, 3.9, 4.0)
    assert keyed.value(x) == pytest.approx(fixed.value(x), rel=1e-13)
    keyed.begin_step(x_t, 0.1, 0.2)
    assert keyed.value(x) == pytest.approx(fixed.value(x) / 3.0, rel=1e-12)


def test_levels_carry_what_follows_time():
    coarse, fine = box(2, 2), box(2, 5, jitter=0.1)
    hierarchy = Hierarchy([coarse, fine], MPI.COMM_SELF)
    body = Body(("grid",), NeoHookean(5.0), regions=(Region(NeoHookean(KEYS), lambda X: X[:, 0] > 0.5),))
    scene = Scene((body,), dt=0.1, steps=1)
    found = [level_materials(scene, hierarchy, level) for level in range(2)]
    ((_, chosen),), ((keys, carried),) = (materials.keyed for materials in found)
    assert keys is KEYS and 0 < carried.sum() < len(carried)
    np.testing.assert_array_equal(carried, chosen[hierarchy.origins(1)])
    np.testing.assert_array_equal(found[1].young == 2.0, carried)
    assert found[0].softest == found[1].softest == 2.0
    falling = make_scene((NeoHookean(Keyed((0.0, 1.0), (8.0, 3.0))), NeoHookean(5.0)))
    assert cell_materials(falling, together(coarse, box(2, 1, 2.0, 3.0))).softest == 3.0
    assert falling.bodies[0].uniform  # in space: nothing is bound


def test_keys():
    assert [KEYS(t) for t in (0.0, 1.0, 2.0, 9.0)] == [2.0, 2.0, 4.0, 6.0]
    assert Keyed(np.array([1.0, 3.0]), [2.0, 6.0]) == KEYS and hash(KEYS) == hash(Keyed([1, 3], [2, 6]))
    assert Pressure("a", KEYS).at(2.0) == 4.0
