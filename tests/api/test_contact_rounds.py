"""The loop of `pdvol.Contact` holds its promise: rounds of moving obstacles never cross, whatever the body does."""

import numpy as np
import pytest
from dolfinx import fem, mesh
from mpi4py import MPI

import pdvol


def contact_with(*obstacles):
    """A cube of 0.2 m, its displacements, and its contact with obstacles and itself."""
    cube = mesh.create_box(MPI.COMM_SELF, ([0, 0, 0.001], [0.2, 0.2, 0.2]), (2, 2, 2), mesh.CellType.tetrahedron)
    V = fem.functionspace(cube, ("Lagrange", 1, (3,)))
    return fem.Function(V), pdvol.Contact(V, 1e4, pdvol.Barrier(dhat=2e-3), None, obstacles)


def press(tilt=0.0, height=0.26, way=(0.0, 0.0, -1.0)):
    place = pdvol.Placement((0.1, 0.1, height), tilt, (0.3, 1.0, 0.0))
    return pdvol.Rigid(pdvol.meshes.box((0.1, 0.1, 0.05)), place, pdvol.Translation(way), "press")


TURNING = pdvol.Rotation(-6.0, (0.4, 0.1, 0.26), (0.0, 1.0, 0.0))
LEVER = pdvol.Rigid(pdvol.meshes.box((0.3, 0.1, 0.05)), pdvol.Placement((0.1, 0.1, 0.32)), TURNING, "lever")
OBSTACLES = [press(way=(0.0, 0.1, -1.0)), press(0.3, way=(0.0, 0.1, -1.0)), LEVER]


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=["press", "tilted", "lever"])
def test_rounds_without_end_neither_cross_nor_close_a_gap(obstacle):
    """The body gives no way. A hundred calls leave a gap of a thousandth of dhat, or nearly so."""
    u, contact = contact_with(obstacle)
    contact.begin_step(u, 0.0, 0.1)
    reached = []
    for _ in range(100):
        reached.append(contact.move_obstacles(u, 0.1))
        assert contact.intersections(u) == 0
    assert np.all(np.diff(reached) >= 0.0) and 0.0 < reached[-1] < 0.1
    assert contact.min_gap(u) > 0.8e-3 * contact.dhat and np.isfinite(contact.energy(u))


def test_a_step_begins_only_where_obstacles_can_be():
    """Rounds may be limited. The next step then says so, and has not put the obstacle inside. One that was not moved in
    the last step is moved at the next one's start.
    """
    u, contact = contact_with(press(height=0.25))
    contact.begin_step(u, 0.0, 0.04)
    for _ in range(10):
        assert contact.move_obstacles(u, 0.04) < 0.04
    with pytest.raises(pdvol.InputError, match=r"contact holds obstacles at t = 0.02\d* s, not 0.04 s; .* call follow"):
        contact.begin_step(u, 0.04, 0.08)
    assert contact.intersections(u) == 0
    u, contact = contact_with(press(height=1.0))
    for step in range(3):
        contact.begin_step(u, 0.1 * step, 0.1 * (step + 1))
    assert contact.move_obstacles(u, 0.3) == 0.3


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_displacements_that_are_not_numbers_are_an_error(bad):
    u, contact = contact_with(pdvol.Plane((0, 0, 0), (0, 0, 1)))
    contact.begin_step(u, 0.0, 0.1)
    du = u.copy()
    du.x.array[3] = bad
    asked = (contact.energy, contact.gradient, contact.hessian, contact.min_gap, contact.count, contact.intersections)
    for ask in (*(lambda of=of: of(du) for of in asked), lambda: contact.max_step(u, du)):
        with pytest.raises(pdvol.InputError, match="displacements are not all finite numbers"):
            ask()
