"""Results depend neither on units nor on where the origin is, and default lengths follow the bodies."""

from dataclasses import replace

import numpy as np
import pytest

import pdvol
from contact_reference import DHAT, KAPPA, brute_force_energy, random_tetrahedra, two_boxes
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Plane, Scene, Solver, Support, meshes
from pdvol.levels.scene_fields import scene_diagonal
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.potential import Positions
from pdvol.scene import Relative, metres
from shapes import cut_block

AWAY, GRAIN = 1024.0, 2.0**-36  # [m]: coordinates that are multiples of the second are moved by the first exactly
MILLIGRAMS = 2.0**-27  # of a kilogram, about 7: a power of two changes no digit
SIDE, STEPS = 0.2, 20
SOFT = NeoHookean(2e4, 0.4, 1000.0)
LENGTH = Relative(1e-3 * np.sqrt(3 / 5))  # of a cube: a thousandth of its own diagonal


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
        held = Support(lambda X: X[:, 0] < -0.1, "body 2", motion=pdvol.Rotation(6.0, (0.02, 0.61)))
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


def speeds(centre: np.ndarray) -> list[float]:
    """Mean speeds of two levels of a block that floats for one step, which is solved, before a wall comes."""
    levels = [cut_block((0.3, 0.2), (n, n), centre + [0.15, 0.1]) for n in (2, 4)]
    wall = Plane(tuple(centre + [-0.01, 0.0]), (1.0, 0.0), pdvol.Translation((0.7, 0.0)))
    scene = Scene(
        (Body(tuple(levels), NeoHookean(5e5, 0.3, 1000.0)),),
        obstacles=(wall,),
        contact=(Barrier(),),
        dt=0.01,
        steps=3,
        solver=Solver(tolerance=pdvol.Relative(1e-6)),
    )
    return [float(step.velocity[:, 0].mean()) for step in pdvol.march(scene)]


def test_a_step_without_motion_leads_the_finer_level_alike_anywhere():
    """Positions differ by round-off in it, or repeat to the last bit, as the place has it: level 1 goes alike."""
    here = speeds(np.zeros(2))
    assert here[1] > 0.3 and here[-1] > 0.7
    for place in ((1.0, 0.0), (1.04, -1.29), (7.7, -2.2)):
        assert speeds(np.array(place)) == pytest.approx(here, abs=1e-5)


# ---- lengths


def cube(name, at, scale=1.0, young=2e4):
    return Body(
        (meshes.brick((SIDE, SIDE, SIDE), (2, 2, 2)),),
        NeoHookean(young, 0.4, 1000.0),
        name=name,
        placement=pdvol.Placement(translate=tuple(scale * np.array(at)), scale=scale),
        velocity=(0.5 * scale, 0.0, 0.0),
    )


def falling(*bodies, scale=1.0, supports=()):
    """Bodies that fall on a floor and slide on it."""
    return Scene(
        bodies,
        dt=0.01,
        integrator="implicit_euler",  # it damps what round-off adds
        steps=STEPS,
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="floor"),),
        loads=(Gravity((0.0, -9.81 * scale, 0.0)),),
        contact=(Barrier(LENGTH), Friction(0.3, eps_v=LENGTH)),
        solver=Solver(tolerance=LENGTH),
        supports=supports,
    )


def states(scene, points=slice(None)):
    level = pdvol.run(scene, progress=False).levels[0]
    return np.array([level.positions(step)[points] for step in range(STEPS + 1)])


NEAR = (0.0, 0.13, 0.0)


@pytest.fixture(scope="module")
def alone():
    return states(falling(cube("near", NEAR)))


def test_a_far_body_changes_no_state_by_more_than_the_tolerance(alone):
    scene = falling(cube("near", NEAR), cube("far", (100.0, 0.13, -3000.0)))
    both = states(scene, slice(alone.shape[1]))
    diagonal = np.sqrt(5) * SIDE  # of the box around the sphere of radius sqrt(5 / 12) SIDE
    assert scene_diagonal(scene) == pytest.approx(diagonal)
    tolerance = metres(scene.solver.tolerance, diagonal) * scene.dt
    assert np.abs(both - alone).max() < tolerance
    # It has fallen, and lies nearer to the floor than a thousandth of its diagonal.
    assert 0.0 < both[-1, :, 1].min() < 1e-3 * diagonal < 0.01 < both[0, :, 1].min()


@pytest.mark.parametrize("scale", [2.0**-12, 2.0**14])
def test_scaled_scenes_move_alike(alone, scale):
    """Lengths, gravity and speeds times s, stiffness times s^2: the same motion, times s. Cubes of 0.05 mm and 3.3 km;
    even powers of two (and their roots) add little round-off that friction and contact could amplify.
    """
    scaled = states(falling(cube("near", NEAR, scale, 2e4 * scale**2), scale=scale))
    apart = np.abs(scaled / scale - alone).max(axis=(1, 2)) / (np.sqrt(5) * SIDE)
    assert (apart <= 3e-14 * np.arange(STEPS + 1)).all()  # round-off, as it adds up step by step


def test_the_diagonal_is_that_of_the_smallest_body_that_is_not_held():
    everywhere = lambda X: np.ones(len(X), dtype=bool)
    large, small = cube("large", NEAR, 3.0), cube("small", (5.0, 1.0, 0.0))
    diagonal = np.sqrt(5) * SIDE  # of the box around the sphere of radius sqrt(5 / 12) SIDE
    held = lambda **how: falling(large, small, supports=(Support(everywhere, body="small", **how),))
    assert scene_diagonal(falling(large)) == pytest.approx(3 * diagonal)
    assert scene_diagonal(falling(large, small)) == pytest.approx(diagonal)
    assert scene_diagonal(held()) == pytest.approx(3 * diagonal)
    assert scene_diagonal(held(release=0.1)) == pytest.approx(diagonal)
    assert scene_diagonal(falling(large, small, supports=(Support(everywhere),))) == pytest.approx(diagonal)
    sides = Support(lambda X: X[:, 0] < 5.0, body="small"), Support(lambda X: X[:, 0] >= 5.0, body="small")
    assert scene_diagonal(falling(large, small, supports=sides)) == pytest.approx(3 * diagonal)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (1.0, 2.0, -0.5)])
def test_the_diagonal_does_not_change_where_the_world_is_turned(axis):
    turned = lambda body: replace(body, placement=replace(body.placement, axis=axis, angle=0.7))
    cubes, bar = cube("cube", NEAR), Body((meshes.brick((0.1, 0.02, 0.02), (4, 1, 1)),), SOFT, name="bar")
    for bodies in ((cubes,), (cubes, bar)):
        scene, other = falling(*bodies), falling(*map(turned, bodies))
        assert scene_diagonal(other) == pytest.approx(scene_diagonal(scene), rel=1e-12)


def test_the_diagonal_of_a_disc_and_a_ball_is_that_of_their_box():
    """And it does not depend on how finely they are drawn, nor on a facet that is turned round."""
    for shape in (meshes.disc(0.3), meshes.disc(0.3, 400)):
        assert scene_diagonal(falling(Body((shape,), SOFT))) == pytest.approx(np.sqrt(2) * 0.6, rel=1e-3)
    ball = meshes.ball(0.3)
    flipped = meshes.Surface(ball.vertices, np.vstack([ball.triangles[:1, ::-1], ball.triangles[1:]]))
    for shape in (ball, flipped):
        assert scene_diagonal(falling(Body((shape,), SOFT))) == pytest.approx(np.sqrt(3) * 0.6, rel=0.02)
