"""Vertices and edges within flat parts of rigid obstacles: which they are, that they push nothing, and that nothing is
let through without them.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from contact_reference import DHAT, KAPPA, surface_of
from pdvol import meshes
from pdvol.levels.script import Obstacle
from pdvol.measure.verify import crossings
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.surface import flat_parts
from pdvol.potentials.potential import Positions
from pdvol.scene import Path, Rotation, Sequential, Still, Translation
from shapes import box, level

NO_EDGES = np.zeros((0, 2), dtype=int)
SHEET = np.array([[0, 1, 2], [0, 2, 3]])


def floor(n, motion=None, bend=0.0, d=3):
    """A square (a line in 2D) of side 4 about the origin, n cells a side, its middle line raised by `bend`."""
    along = np.linspace(-2.0, 2.0, n + 1)
    motion = Still() if motion is None else motion
    if d == 2:
        line = np.column_stack([np.arange(n), np.arange(1, n + 1)])
        points = np.column_stack([along, bend * (along == 0.0)])
        return Obstacle("floor", "polyline", points, line, np.zeros((0, 3), dtype=int), motion, closed=False)
    x, y = (axis.ravel() for axis in np.meshgrid(along, along, indexing="ij"))
    low = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate(
        [np.column_stack(c) for c in ([low, low + n + 1, low + 1], [low + 1, low + n + 1, low + n + 2])]
    )
    points = np.column_stack([x, y, bend * (x == 0.0)])
    return Obstacle("floor", "mesh", points, NO_EDGES, faces, motion, closed=False)


def parts_of(vertices, faces):
    sides = np.sort(np.asarray(faces)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, numbers = np.unique(sides, axis=0, return_inverse=True)
    return edges, *flat_parts(np.asarray(vertices, dtype=float), np.asarray(faces), edges, numbers.reshape(-1, 3))


def test_a_box_has_flat_parts_within_its_sides():
    """In any orientation, at any place: vertices away from its twelve edges, and edges that are not on them."""
    shape = meshes.box((1.0, 2.0, 3.0), (2, 3, 4))
    outline = np.isclose(np.abs(shape.vertices), [0.5, 1.0, 1.5])
    for seed in range(3):
        turn = Turn.random(random_state=seed).as_matrix() if seed else np.eye(3)
        edges, vertices, flat = parts_of(shape.vertices @ turn.T + seed * np.array([7.0, -3.0, 1.0]), shape.triangles)
        np.testing.assert_array_equal(vertices, outline.sum(axis=1) == 1)
        np.testing.assert_array_equal(flat, ~((outline[edges[:, 0]] & outline[edges[:, 1]]).sum(axis=1) >= 2))
        assert vertices.any() and flat.any() and not flat.all()


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        ([[0, 0, 0], [1, 0, 0], [1, 1, 1e-8], [0, 1, 0]], SHEET),  # a ridge
        ([[0, 0, 0], [1, 0, 0], [1, 1, -1e-8], [0, 1, 0]], SHEET),  # a valley
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0.9, 0.2, 0]], SHEET),  # folded onto itself
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1]], [*SHEET, [0, 2, 4]]),  # three facets
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], SHEET),  # one without an area
    ],
)
def test_what_is_not_flat(vertices, faces):
    _, points, edges = parts_of(vertices, faces)
    assert not points.any() and not edges.any()
    _, points, edges = parts_of([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], SHEET)
    assert not points.any() and edges.sum() == 1


def test_a_straight_line_is_flat_between_its_ends():
    points = np.array([[0, 0], [1, 1], [3, 3], [4, 3], [2, 3], [2, 2.5]], dtype=float)
    line = np.array([[0, 1], [2, 1], [2, 3], [3, 4], [4, 5]])  # straight on, a corner, and back
    vertices, edges = flat_parts(points, line, NO_EDGES, np.zeros((0, 3), dtype=int))
    assert vertices.tolist() == [False, True, False, False, False, False] and not len(edges)


def fallen(d, obstacles):
    """A crooked box 0.6 dhat above a floor at zero, tilted by a tenth of dhat."""
    low = np.r_[np.full(d - 1, 0.113), 0.6 * DHAT]
    mesh = box(d, 2, low=low, high=low + 1.0, jitter=0.05, seed=3)
    height = mesh.points[:, -1]
    height[height < 0.5] = 0.6 * DHAT
    height += 0.1 * DHAT * mesh.points[:, 0]
    space, candidates = surface_of(level(mesh.points, mesh.cells), obstacles=obstacles)
    return space, ContactBarrier(candidates, KAPPA)


def forces(found):
    space, barrier = found
    return -space.to_input(barrier.gradient(Positions(space, space.from_input(space.mesh.points))))


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("moves", [False, True])
def test_a_flat_floor_pushes_straight_up_however_it_is_cut(d, moves):
    away = Path((0.0, 1.0), ((0.0,) * d, (1.0,) * d))
    motion = Sequential((Translation((0.0,) * d), Rotation(1.0, (0.0,) * d), away)) if moves else None
    expected = forces(fallen(d, (floor(1, motion, d=d),)))
    assert expected[:, -1].sum() > 0.0
    np.testing.assert_allclose(expected[:, :-1], 0.0, atol=1e-12 * np.abs(expected).max())
    for n in (2, 7, 60):
        found = forces(fallen(d, (floor(n, motion, d=d),)))
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    ("motion", "bend"), [(lambda X, t: X, 0.0), (Sequential((Still(), lambda X, t: X)), 0.0), (None, 1e-6)]
)
def test_what_may_bend_or_is_bent_keeps_all_its_contacts(d, motion, bend):
    """Nothing is known of users' own motions, and a ridge may be the first that is touched."""
    counts = []
    for obstacle in (floor(8, motion, bend, d), floor(8, d=d)):
        space, barrier = fallen(d, (obstacle,))
        counts.append(barrier.count(Positions(space, space.from_input(space.mesh.points))))
    assert counts[0] > counts[1] > 0


@pytest.mark.parametrize("depth", [1.0, 0.2])
@pytest.mark.parametrize("size", [0.3, 1.5])
def test_nothing_passes_through_a_box_that_is_cut_finely(depth, size):
    """Tetrahedra thrown at it from all sides, onto its sides, edges and corners, some of them larger than it and
    deforming: nothing crosses after moves that collision detection ends, by an independent check.
    """
    rng = np.random.default_rng(1)
    shape = meshes.box((1.0, 1.0, depth), (6, 5, 4))
    faces, ended, let_through = np.asarray(shape.triangles, dtype=int), 0, 0
    for throw in range(20):
        solid = shape.vertices @ (Turn.random(random_state=rng).as_matrix() if throw % 3 else np.eye(3)).T
        corners = rng.standard_normal(3)
        corners = (1.0 + 1.8 * size) * corners / np.linalg.norm(corners) + size * rng.uniform(-1, 1, (4, 3))
        corners = corners if np.linalg.det(corners[1:] - corners[0]) > 0.0 else corners[[1, 0, 2, 3]]
        obstacle = Obstacle("box", "mesh", solid, NO_EDGES, faces)
        space, candidates = surface_of(level(corners, [[0, 1, 2, 3]]), obstacles=(obstacle,))
        x, own = (
            candidates.surface.vertices(Positions(space, space.from_input(space.mesh.points))),
            candidates.surface.objects == 0,
        )
        facets = candidates.primitives.facets[:4].astype(int)
        assert not crossings(x[own], facets, [(solid, faces)])
        for _ in range(3):
            end = x.copy()
            end[own] -= x[own].mean(axis=0) + rng.uniform(-0.5, 0.5, 3)
            end[own] += 0.3 * (throw % 2) * rng.standard_normal((4, 3))
            step = candidates.max_step(x, end)
            let_through += step < 1.0 and bool(crossings((x + 1.1 * step * (end - x))[own], facets, [(solid, faces)]))
            ended += step < 1.0
            x = x + step * (end - x)
            assert not crossings(x[own], facets, [(solid, faces)])
    assert ended > 30 and let_through > 10, "moves do not end at the box"
