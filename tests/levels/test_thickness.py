"""Cells through the thinnest part of a body are those that its mesh has there."""

import time

import numpy as np
import pytest

from pdvol import Body, NeoHookean, Scene, meshes
from pdvol.levels.level_check import MOST_CELLS, cells_through
from pdvol.meshing.build import build_levels
from shapes import solid


def levels(shape, targets=()):
    return build_levels(Scene((Body(shape, NeoHookean(1e5), targets),), dt=0.01, steps=1))


@pytest.mark.parametrize("cells", [1, 2, 3, 5])
def test_cells_of_a_plate(cells):
    (plate,) = levels((meshes.brick((1.0, 0.7, 0.1), (8, 6, cells)),))
    assert cells_through(plate, 0) == (cells, pytest.approx(0.1, rel=1e-9))


@pytest.mark.parametrize("d", [2, 3])
def test_cells_of_a_cube(d):
    (cube,) = levels((solid(d, 3),))
    assert cells_through(cube, 0) == (3, pytest.approx(1.0, rel=1e-9))
    (one,) = levels((solid(d, 1),))
    assert cells_through(one, 0)[0] == 1


def test_an_ear_is_the_thinnest_part():
    """A plate of two cells on a block of eight; every level counts where the shape is thinnest."""
    block, ear = meshes.brick((1.0, 1.0, 1.0), (8, 8, 8)), meshes.brick((0.5, 0.5, 0.1), (4, 4, 2))
    both = meshes.Solid(
        np.vstack([block.vertices, ear.vertices + (5.0, 0.0, 0.0)]),
        np.vstack([block.cells, ear.cells + len(block.vertices)]),
        np.zeros(len(block.cells) + len(ear.cells), np.int32),
    )
    assert cells_through(levels((both,))[0], 0) == (2, pytest.approx(0.1, rel=1e-9))


def test_each_level_of_a_thin_box_in_little_time():
    made = levels(meshes.box((0.9, 0.9, 0.05), (1, 1, 1)), (300, 10_000))
    begin = time.process_time()
    assert [cells_through(mesh, 0) for mesh in made] == [(1, pytest.approx(0.05)), (2, pytest.approx(0.05))]
    assert time.process_time() - begin < 1.0
    assert cells_through(levels((meshes.brick((1.0, 1.0, 1.0), (12, 12, 12)),))[0], 0)[0] == MOST_CELLS
