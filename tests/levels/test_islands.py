"""Vertices that lie in another branch of the coarser level than their neighbours are bound to their neighbours' branch.
The branch of each vertex is known by its place along the curve.
"""

from itertools import permutations, product

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.levels.binding import ISLAND, bind, find_islands
from pdvol.levels.geodesic import bind_outside
from pdvol.levels.locate import containing_cells
from pdvol.levels.space import LevelSpace
from shapes import box, level, together


def strip(curve, along, width, across, layers, height, rise=0.0):
    """A strip along a curve that rises by so much per radian, with the place along it of each vertex; in 2D where
    `layers` is 0.
    """
    dim, cells = 3 if layers else 2, []
    shape = (len(along), across + 1, layers + 1)
    points = np.empty((*shape, dim))
    for i, k, z in product(*map(range, shape)):
        point, normal = curve(along[i])
        points[i, k, z, :2] = point + normal * width * (k / across - 0.5)
        points[i, k, z, 2:] = height * z / max(layers, 1) + rise * along[i]
    for corner in product(range(len(along) - 1), range(across), range(max(layers, 1))):
        for axes in permutations(range(dim)):
            path = [list(corner)]
            for axis in axes:
                path.append([c + (a == axis) for a, c in enumerate(path[-1])])
            cells.append([np.ravel_multi_index(p, shape) for p in path])
    return level(points.reshape(-1, dim), cells), np.repeat(along, (across + 1) * (layers + 1))


def spiral(inner, pitch, shape):
    """An ellipse's or a rounded square's, where `shape` is not round."""

    def at(turn):
        way = np.array([np.cos(turn), np.sin(turn)])
        size = (np.abs(way) ** 4).sum() ** -0.25 if shape == "square" else 1.0
        axes = np.array([1.5, 1.0]) if shape == "ellipse" else 1.0
        return (inner + pitch * turn / (2.0 * np.pi)) * size * axes * way, size * axes * way

    return at


@pytest.mark.parametrize(
    ("inner", "pitch", "width", "turns", "chords", "layers", "shape"),
    [
        (0.35, 0.13, 0.10, 3, 6, 0, "round"),
        (0.35, 0.13, 0.10, 3, 7, 2, "round"),
        (0.53, 0.08, 0.06, 4, 9, 2, "round"),
        (0.35, 0.13, 0.10, 3, 8, 0, "ellipse"),
        (0.35, 0.13, 0.10, 3, 10, 2, "square"),
        (0.35, 0.13, 0.10, 3, 8, 2, "cone"),
        (0.35, 0.13, 0.10, 3, 24, 2, "round"),
    ],
)
def test_every_vertex_of_a_spiral_is_bound_to_its_own_turn(inner, pitch, width, turns, chords, layers, shape):
    curve, end, rise = spiral(inner, pitch, shape), 2.0 * np.pi * turns, 0.01 if shape == "cone" else 0.0
    along = np.linspace(0.0, end, 60 * turns + 1)
    along[1:-1] += end / (60 * turns) * np.random.default_rng(0).uniform(-0.3, 0.3, len(along) - 2)
    coarse, of_coarse = strip(curve, np.linspace(0.0, end, chords * turns + 1), width, 1, min(layers, 1), 0.2, rise)
    fine, of_fine = strip(curve, along, width, 3, layers, 0.2, rise)
    space = LevelSpace(coarse, MPI.COMM_SELF)
    off = lambda cells: np.abs(of_coarse[coarse.cells[cells]].mean(axis=1) - of_fine) > 0.5 * 2.0 * np.pi
    inside = containing_cells(fine.points, fine.point_bodies, space)
    by_rays, binding = bind_outside(fine, coarse, inside)[0], bind(fine, space)
    wrong = off(by_rays)
    assert wrong.any() == (chords < 24), "coarse chords reach into the next turn"
    assert not off(binding.cells).any()
    assert np.all((binding.kind == ISLAND)[wrong])
    kept = binding.kind != ISLAND
    np.testing.assert_array_equal(binding.cells[kept], by_rays[kept])
    assert binding.report()["islands"] == np.count_nonzero(~kept)


def test_a_bridge_between_two_parts_of_the_coarse_level_is_no_island():
    """No way leads from one part to the other, but each part is home to its own half alone."""
    halves = together(box(3, 2), box(3, 2))
    second = np.arange(len(halves.points))[:, None] >= len(halves.points) // 2
    coarse = level(halves.points + np.where(second, [1.2, 0.0, 0.0], 0.0), halves.cells)
    long = box(3, 5)
    fine = level(long.points * [2.2, 1.0, 1.0], long.cells)
    inside = containing_cells(fine.points, fine.point_bodies, LevelSpace(coarse, MPI.COMM_SELF))
    assert not find_islands(fine, coarse, bind_outside(fine, coarse, inside)[0]).any()


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(("fine", "coarse"), [(7, 3), (3, 7), (5, 5)])
def test_a_block_has_no_islands_either_way_round(dim, fine, coarse):
    levels = box(dim, fine), box(dim, coarse)
    assert bind(levels[0], LevelSpace(levels[1], MPI.COMM_SELF)).report()["islands"] == 0
