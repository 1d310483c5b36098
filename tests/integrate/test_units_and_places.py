"""Results depend neither on the unit of mass nor on where the origin is."""

import numpy as np
import pytest
from mpi4py import MPI

import pdvol
from contact_reference import DHAT, KAPPA, brute_force_energy, random_tetrahedra, two_boxes
from pdvol import Attachment, Barrier, Body, Gravity, NeoHookean, Plane, Relative, Rotation, Scene, Solver, Support
from pdvol.levels.attachments import bound_springs
from pdvol.levels.space import LevelSpace
from pdvol.potentials.attachments import Attachments
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.potential import Positions
from problems import SOFT, make_scene
from shapes import box, cut_block, together

AWAY, GRAIN = 1024.0, 2.0**-36  # [m]: coordinates that are multiples of the second are moved by the first exactly
MILLIGRAMS = 2.0**-27  # of a kilogram, about 7: a power of two changes no digit


@pytest.mark.parametrize(("away", "tolerance"), [((1e3, 0.0), 1e-6), ((0.0, 1e4), 1e-3)])
def test_a_block_settles_far_from_the_origin_as_at_it(away, tolerance):
    """A load's energy is that of displacements: of positions, 10 km up, it would hide what a line search looks for."""

    def settles(place):
        body = Body((cut_block((0.3, 0.24), (3, 2), place + [0.0, 0.1235]),), NeoHookean(8e4, 0.3, 1600.0))
        scene = Scene(
            (body,),
            obstacles=(Plane(tuple(place), (0.0, 1.0)),),
            loads=(Gravity((0.0, -9.81)),),
            contact=(Barrier(Relative(0.01)),),
            dt=0.01,
            steps=20,
            solver=Solver(tolerance=Relative(tolerance)),
        )
        return [(step.positions - place, step.report.newton_iterations) for step in pdvol.march(scene)]

    near, far = settles(np.zeros(2)), settles(np.array(away))
    assert max(count for _, count in far) <= max(count for _, count in near) + 2
    assert max(np.abs(one - other).max() for (one, _), (other, _) in zip(near, far, strict=True)) < 1e-7


def test_bodies_of_milligrams_move_as_those_of_kilograms():
    """Three blocks on each other, the top one turned by a support. Prescribed displacements in metres do not enter the
    residual of conjugate gradients, whose free rows are in kg m.
    """

    def turned(mass):
        bodies = tuple(
            Body(
                (cut_block((0.4, 0.3), (3, 2), [0.0, 0.151 + 0.3013 * number]),),
                NeoHookean(mass * young, 0.45, 1000.0 * mass),
                name=f"body {number}",
            )
            for number, young in enumerate((2e3, 8e3, 5e5))
        )
        held = Support(lambda X: X[:, 0] < -0.1, "body 2", motion=Rotation(6.0, (0.02, 0.61)))
        scene = Scene(
            bodies,
            supports=(held,),
            obstacles=(Plane((0.0, 0.0), (0.0, 1.0)),),
            contact=(Barrier(),),
            dt=0.02,
            steps=4,
            integrator="implicit_euler",
        )
        return list(pdvol.march(scene))

    for one, other in zip(turned(1.0), turned(MILLIGRAMS), strict=True):
        assert one.report.behind == other.report.behind
        assert abs(one.report.newton_iterations - other.report.newton_iterations) <= 2
        assert np.abs(one.positions - other.positions).max() < 1e-5 * 0.4


@pytest.mark.parametrize("d", [2, 3])
def test_contact_does_not_see_where_the_origin_is(d):
    """To the last bit, a kilometre off: a gap is a sum of differences, of which none is rounded here."""
    spaces = [two_boxes(d, obstacle=False)]
    if d == 3:  # pairs of edges that cross
        spaces += [random_tetrahedra(seed, size=(0.5 + seed % 5) * DHAT) for seed in range(40)]
    edges = 0
    for seed, (space, candidates) in enumerate(spaces):
        barrier = ContactBarrier(candidates, KAPPA)
        noise = 0.1 * DHAT * np.random.default_rng(seed).uniform(-1.0, 1.0, space.mesh.points.shape)
        x = np.round(space.from_input(space.mesh.points + noise) / GRAIN) * GRAIN
        found = [(barrier.value(at), barrier.gradient(at)) for at in (Positions(space, x), Positions(space, x + AWAY))]
        assert found[0][0] == found[1][0] > 0.0 or found[0][0] == 0.0
        np.testing.assert_array_equal(found[0][1], found[1][1])
        edges += sum(brute_force_energy(candidates, candidates.surface.vertices(Positions(space, x)))[1:]) > 0.0
    assert d == 2 or edges > 10


@pytest.mark.parametrize("d", [2, 3])
def test_springs_do_not_see_where_the_origin_is(d):
    """As contact: between points within facets, whose weights are not those of vertices."""
    mesh = together(box(d, 2, jitter=0.1, seed=1), box(d, 3, (1.2, *(0.1,) * (d - 1)), 2.0, jitter=0.1))
    scene = make_scene(
        (SOFT, SOFT), attachments=(Attachment("body 0", "body 1", lambda X: X[:, 0] > 0.9, stiffness=300.0),)
    )
    (springs,) = bound_springs(scene, mesh, mesh.points, mesh, mesh.points)
    term = Attachments(LevelSpace(mesh, MPI.COMM_SELF), springs)
    moved = mesh.points + 0.1 * np.random.default_rng(2).uniform(-1.0, 1.0, mesh.points.shape)
    x = term.space.from_input(np.round(moved / GRAIN) * GRAIN)
    (value, gradient), (far, there) = (
        (term.value(at), term.gradient(at)) for at in (Positions(term.space, x), Positions(term.space, x + AWAY))
    )
    assert value == far > 0.0
    np.testing.assert_array_equal(gradient, there)
