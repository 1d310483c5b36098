"""Springs between bodies, and muscles: totals that no mesh changes, and the same material on every level."""

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.attachments import bound_springs
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.locate import nearest_material
from pdvol.levels.materials import level_muscles
from pdvol.levels.space import LevelSpace
from pdvol.potentials.attachments import Attachments
from pdvol.potentials.potential import Positions
from pdvol.scene import Attachment, Muscle, NeoHookean, Solver, Support
from problems import SOFT, block, make_scene, make_stepper, take_step
from shapes import box, together
from taylor import hessian_of

DIMENSIONS = [2, 3]
STIFFNESS, GAP = 300.0, 0.2


def right(X):
    """The facets on the first cube's right side, by their centres."""
    return X[:, 0] > 1.0 - 1e-9


def cubes(d, n, jitter=0.0):
    """Two unit cubes side by side, `GAP` apart."""
    return together(box(d, n, jitter=jitter, seed=1), box(d, n, (1.0 + GAP, *(0.1,) * (d - 1)), 2.0, jitter=jitter))


def scene(**settings):
    given = {"where": right, "stiffness": STIFFNESS} | settings
    return make_scene((SOFT, SOFT), attachments=(Attachment("body 0", "body 1", **given),))


def term(mesh, **settings):
    (springs,) = bound_springs(scene(**settings), mesh, mesh.points, mesh, mesh.points)
    return Attachments(LevelSpace(mesh, MPI.COMM_SELF), springs)


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize("n", [1, 2, 5])
def test_totals_do_not_depend_on_the_mesh(d, n):
    """The second cube moves away by `GAP`: all springs, as wide as the gap at first, pull with k GAP together."""
    mesh = cubes(d, n)
    found = term(mesh, where=lambda X: right(X) & (X[:, 1:] > 0.1).all(axis=1))
    x = Positions(found.space, found.space.from_input(mesh.points))
    assert found.value(x) < 1e-28 and np.abs(found.gradient(x)).max() < 1e-12
    away = mesh.points + GAP * np.outer(mesh.point_bodies == 1, np.eye(d)[0])
    force = -found.space.to_input(found.gradient(Positions(found.space, found.space.from_input(away))))
    first = force[mesh.point_bodies == 0].sum(axis=0)
    np.testing.assert_allclose(first, STIFFNESS * GAP * np.eye(d)[0], atol=1e-9)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_spring_without_length_has_finite_derivatives(d):
    """Pin to pin at one place: nothing pulls, and the stiffness is k in all directions where the rest length is 0."""
    mesh = cubes(d, 2)
    place = np.array((1.0, *(0.5,) * (d - 1)))
    found = term(mesh, where=place, to=place + GAP * np.eye(d)[0], rest_length=0.0)
    assert found.springs.points.shape == (1, 2 * d + 2)
    owned = found.space.from_input(mesh.points - np.outer(mesh.point_bodies == 1, GAP * np.eye(d)[0]))
    assert found.value(Positions(found.space, owned)) == pytest.approx(0.0, abs=1e-20)
    rows = hessian_of(found, found.space, owned).toarray()
    # Both cubes moved apart along any axis: k times the distance squared.
    for axis in np.eye(d):
        apart = found.space.from_input(np.outer(mesh.point_bodies == 1, axis)).ravel()
        assert apart @ rows @ apart == pytest.approx(STIFFNESS, rel=1e-12)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_levels_share_springs_and_material(d):
    """Springs of the coarsest level lead from the same rest positions on a finer one, whatever its cells."""
    coarse, fine = cubes(d, 1), cubes(d, 4)
    ends = []
    for mesh in (coarse, fine):
        (bound,) = bound_springs(scene(), coarse, coarse.points, mesh, mesh.points)
        d1 = d + 1
        for part, sign, body in ((slice(None, d1), -1.0, 0), (slice(d1, None), 1.0, 1)):
            weights, points = sign * bound.weights[:, part], mesh.points[bound.points[:, part]]
            assert weights.min() >= 0.0 and (mesh.point_bodies[bound.points[:, part]] == body).all()
            ends.append(np.einsum("ka,kai->ki", weights, points))
    np.testing.assert_allclose(ends[:2], ends[2:], atol=1e-12)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_nearest_material(d):
    """Inside, the point itself; outside, as far away as the box that the body is."""
    mesh = cubes(d, 3)
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.3, 2.3, (60, d))
    bodies = rng.integers(0, 2, 60)
    cells, weights = nearest_material(mesh, points, bodies)
    assert (mesh.bodies[cells] == bodies).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-13)
    places = np.einsum("ka,kai->ki", weights, mesh.points[mesh.cells[cells]])
    low, high = np.array([[0.0] * d, [1.0 + GAP, *(0.1,) * (d - 1)]]), np.array([[1.0] * d, [2.0] * d])
    inside = ((points > low[bodies] + 0.05) & (points < high[bodies] - 0.05)).all(axis=1)
    assert 3 <= inside.sum() < 50
    np.testing.assert_allclose(places[inside], points[inside], atol=1e-12)
    out = np.linalg.norm(places - points, axis=1)
    box_distance = np.linalg.norm(np.maximum(0.0, np.maximum(low[bodies] - points, points - high[bodies])), axis=1)
    np.testing.assert_allclose(out, box_distance, atol=1e-12)


def test_the_cell_around_a_point_is_found_among_many_smaller_ones():
    """A fan of triangles on a strip of 600 small ones, all of whose centres are nearer to the point than its own
    triangle's.
    """
    x = np.linspace(0.0, 1.0, 301)
    points = np.concatenate([[[0.5, 1.0]], *(np.column_stack([x, np.full(301, y)]) for y in (0.0, -0.001))])
    left, below = np.arange(1, 301), np.arange(302, 602)
    fan = np.column_stack([np.zeros(300, dtype=np.int64), left, left + 1])
    strip = np.concatenate([np.column_stack([below, below + 1, left]), np.column_stack([below + 1, left + 1, left])])
    cells = np.concatenate([fan, strip])
    none = np.zeros(len(cells), dtype=np.int32)
    mesh, point = LevelMesh(points, cells, none, none), np.array([[0.501, 0.01]])
    found, weights = nearest_material(mesh, point, np.zeros(1, dtype=np.int64))
    assert found[0] < 300
    np.testing.assert_allclose(weights @ mesh.points[cells[found[0]]], point, atol=1e-12)


# ---- muscles: an equilibrium worked out by hand, and cells carried through levels


def turning(X):
    """A fibre field of no constant length."""
    return 2.0 * np.column_stack([np.cos(X[:, 0]), np.sin(X[:, 0]), *([0.3 + 0.0 * X[:, 0]] * (X.shape[1] - 2))])


@pytest.mark.parametrize("d", DIMENSIONS)
def test_the_length_of_a_bar_that_contracts(d):
    """Without Poisson's effect P = mu (F - 1/F) + T F = 0 along the fibre: F = sqrt(mu / (mu + T))."""
    material = NeoHookean(1e5, 0.0, 1000.0)
    fibre = np.eye(d)[0]
    seconds = 100.0
    scene = make_scene(
        (material,),
        dt=seconds,
        supports=(Support(lambda X: (X < 1e-9).all(axis=1)),),
        muscles=(Muscle("body 0", tuple(3.0 * fibre), 3e4, 0.5),),
        solver=Solver(tolerance=1e-6 / seconds, linear="direct"),
    )
    mesh = block((0.0,) * d, (1.0,) + (0.2,) * (d - 1), (4,) + (1,) * (d - 1))
    stepper = make_stepper(scene, mesh)
    x = mesh.points
    for number in (1, 2):
        x = take_step(stepper, number, x, 0.0 * x).positions
    sizes = np.linalg.norm(x[:, None] - x[None], axis=2).max(), np.linalg.norm(mesh.points.max(axis=0))
    F = np.sqrt(material.mu / (material.mu + 0.5 * 3e4))
    assert sizes[0] == pytest.approx(np.hypot(F, 0.2 * np.sqrt(d - 1)), rel=1e-5)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_finer_levels_take_cells_places_and_fibres_of_the_coarsest(d):
    coarse, fine = box(d, 2, jitter=0.1, seed=1), box(d, 4, jitter=0.1, seed=2)
    hierarchy = Hierarchy([coarse, fine], MPI.COMM_SELF)
    scene = make_scene((SOFT,), muscles=(Muscle("body 0", turning, 3e4, where=lambda X: X[:, 0] > 0.5),))
    (above,), (found,) = (level_muscles(scene, hierarchy, level) for level in range(2))
    origins = hierarchy.origins(1)
    assert np.array_equal(found.cells, np.flatnonzero(np.isin(origins, above.cells)))
    assert 0 < len(found.cells) < len(fine.cells)
    centres = coarse.points[coarse.cells].mean(axis=1)
    np.testing.assert_array_equal(found.places, centres[origins[found.cells]])
    np.testing.assert_allclose(found.fibres, Muscle("b", turning, 1.0).fibres(found.places), rtol=1e-15)
