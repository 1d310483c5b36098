"""How cells are shared out among ranks where bodies will touch."""

import numpy as np
import pytest

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.partition import carried, shared_cells
from shapes import box, level, together


def stack(dim: int, axis: int) -> LevelMesh:
    """Two unit cubes (squares), one beyond the other along an axis."""
    first = box(dim, 4, jitter=0.2)
    return together(first, placed(first, 1.01 * np.eye(dim)[axis]))


def halved(mesh: LevelMesh, *places):
    """The rank of each cell, of two ranks, which both have about half of both bodies."""
    owner = shared_cells(mesh, 2, *places)
    for body in (0, 1):
        assert 0.4 < np.mean(owner[mesh.bodies == body]) < 0.6
    return owner


def placed(mesh: LevelMesh, shift) -> LevelMesh:
    return level(mesh.points + shift, mesh.cells)


@pytest.mark.parametrize("dim, axis", [(2, 0), (2, 1), (3, 0), (3, 1), (3, 2)])
def test_two_ranks_share_a_stack_sideways(dim, axis):
    mesh = stack(dim, axis)
    owner = halved(mesh)
    # The cut runs through both bodies at one place: what touches lies on one rank.
    centres = mesh.points[mesh.cells].mean(axis=1)
    cut = max(
        (i for i in range(dim) if i != axis),
        key=lambda i: np.ptp([centres[owner == rank, i].mean() for rank in (0, 1)]),
    )
    for body in (0, 1):
        mine = mesh.bodies == body
        assert centres[mine & (owner == 0), cut].max() <= centres[mine & (owner == 1), cut].min()


def test_every_rank_gets_its_share():
    """Where there are more ranks than cells, some have none."""
    for ranks in (1, 3, 4, 5):
        owner = shared_cells(stack(3, 1), ranks)
        counts = np.bincount(owner, minlength=ranks)
        assert len(counts) == ranks and counts.min() > 0.6 * len(owner) / ranks
    (owner,) = shared_cells(level(np.eye(3, 2), [[0, 1, 2]]), 4)
    assert 0 <= owner < 4


@pytest.mark.parametrize("ranks", [2, 3])
def test_many_bodies_are_not_cut(ranks):
    """Each rank gets bodies that are side by side along the longest way, and its share of cells."""
    places = np.stack(np.meshgrid(range(6), range(2), range(2), indexing="ij"), axis=-1).reshape(-1, 3) * 1.05
    count = len(places)
    mesh = together(*(placed(box(3, 2, jitter=0.2), place) for place in places))
    owner = shared_cells(mesh, ranks).reshape(count, -1)
    assert (owner == owner[:, :1]).all()
    assert list(np.bincount(owner[:, 0])) == [count // ranks] * ranks
    assert (np.diff(owner[np.argsort(places[:, 0], kind="stable"), 0]) >= 0).all()


def test_bodies_of_unequal_size_are_cut_where_no_sum_is_near_a_half():
    shapes = [box(3, 5), *[box(3, 1)] * 8]
    mesh = together(*(placed(shape, [1.1 * k, 0.0, 0.0]) for k, shape in enumerate(shapes)))
    assert abs(np.bincount(shared_cells(mesh, 2)) / len(mesh.cells) - 0.5).max() < 0.05


def test_bodies_are_cut_where_they_will_touch():
    """Two cubes that lie side by side at rest, and on each other later: each rank gets a part of both."""
    mesh = stack(3, 0)
    aside = shared_cells(mesh, 2)
    places = mesh.points.copy()
    places[mesh.point_bodies == 1] += [-1.01, 0.0, 1.01]
    owner = halved(mesh, places)
    centres = places[mesh.cells].mean(axis=1)
    assert any(centres[owner == 0, axis].max() <= centres[owner == 1, axis].min() for axis in (0, 1))
    assert (owner != aside).any()


@pytest.mark.parametrize("dim", [2, 3])
def test_finer_vertices_are_carried_by_the_cells_near_them(dim):
    """Each body by its own affine motion, exactly; the coarser body does not have to contain the finer one."""
    coarse, fine = (together(shape, placed(shape, 1.001)) for shape in (box(dim, 2), box(dim, 5, low=-0.02, high=1.02)))
    rng = np.random.default_rng(0)
    maps, shifts = rng.standard_normal((2, dim, dim)), rng.standard_normal((2, dim))
    moved = lambda mesh: (maps[mesh.point_bodies] @ mesh.points[..., None])[..., 0] + shifts[mesh.point_bodies]
    np.testing.assert_allclose(carried(coarse, moved(coarse), fine), moved(fine), atol=1e-12)
