"""Binding: which points are inside, whether they find the right branch and the right body, and whether any number of
ranks gives the same result.
"""

import numpy as np
import pytest
from mpi4py import MPI

from demos.recipes.closest_binding import closest_binding
from on_ranks import results_on
from pdvol.errors import MeshError
from pdvol.geometry.boundary_search import BoundarySearch
from pdvol.levels.binding import CLOSEST, INSIDE, NEIGHBOUR, RAY, bind
from pdvol.levels.geodesic import bind_outside
from pdvol.levels.locate import containing_cells
from pdvol.levels.prolongation import Prolongation
from pdvol.levels.space import LevelSpace
from pdvol.registry import INTERPOLANTS
from shapes import box, comb, comb_branch, fold, fold_branch, level, together

COMM = MPI.COMM_WORLD

# The coarse branches are thin and lie off-centre in the fine ones, so that part of a fine branch is nearer to the wrong
# coarse one; the fine tips stick out.
FINE_TEETH, COARSE_TEETH = [(0.0, 0.5), (0.6, 1.1), (1.2, 1.7)], [(0.02, 0.22), (0.62, 0.82), (1.22, 1.68)]
FINE_ARMS, COARSE_ARMS = ((0.0, 0.5), (0.6, 1.1)), ((0.02, 0.2), (0.63, 1.08))


def comb_pair(d):
    fine = comb(d, 3, FINE_TEETH, height=1.5)
    coarse = comb(d, 1, COARSE_TEETH, height=1.3)
    return fine, coarse, comb_branch(fine.points, FINE_TEETH), comb_branch(centroids(coarse), COARSE_TEETH)


def fold_pair(d):
    fine = fold(d, 3, *FINE_ARMS)
    coarse = fold(d, 1, *COARSE_ARMS, left=0.1, right=1.02)
    return fine, coarse, fold_branch(fine.points, *FINE_ARMS), fold_branch(centroids(coarse), *COARSE_ARMS)


def centroids(mesh):
    return mesh.points[mesh.cells].mean(axis=1)


def wrong_branch(binding, points, cells):
    home = cells[binding.cells]
    return int(((points >= 0) & (home >= 0) & (points != home)).sum())


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("pair", [comb_pair, fold_pair])
def test_only_the_euclidean_binding_takes_the_wrong_branch(pair, d):
    fine, coarse, fine_branch, coarse_branch = pair(d)
    space = LevelSpace(coarse, COMM)
    assert wrong_branch(closest_binding(fine, space), fine_branch, coarse_branch) > 0
    binding = bind(fine, space)
    assert wrong_branch(binding, fine_branch, coarse_branch) == 0
    assert set(binding.kind) == {INSIDE, RAY, NEIGHBOUR}


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("pair", [comb_pair, fold_pair])
def test_coarse_points_are_bound_to_a_fine_mesh(pair, d):
    """Coarse points are bound to a fine mesh. They are displaced so that some lie outside it."""
    fine, coarse, _, coarse_cells = pair(d)
    shifted = level(coarse.points - 0.05, coarse.cells)
    branch = np.full(len(coarse.points), -1)
    branch[coarse.cells[coarse_cells >= 0]] = coarse_cells[coarse_cells >= 0][:, None]
    own = comb_branch(centroids(fine), FINE_TEETH) if pair is comb_pair else fold_branch(centroids(fine), *FINE_ARMS)
    binding = bind(shifted, LevelSpace(fine, COMM))
    assert (binding.kind == INSIDE).any() and (binding.kind == RAY).any()
    assert wrong_branch(binding, branch, own) == 0


@pytest.mark.parametrize("d", [2, 3])
def test_inside_points_get_the_lowest_containing_cell(d):
    coarse, fine = box(d, 3, jitter=0.2), box(d, 5, 0.1, 0.9)
    # The coarse vertices themselves and facet centres are shared by several cells.
    points = np.concatenate(
        [coarse.points, coarse.points[coarse.cells].mean(axis=1), coarse.points[coarse.cells[:, :d]].mean(axis=1)]
    )
    target = level(np.concatenate([points, fine.points]), fine.cells + len(points))
    binding = bind(target, LevelSpace(coarse, COMM))
    assert (binding.kind[: len(points)] == INSIDE).all()
    assert binding.weights[: len(points)].min() > -1e-10
    for p, home in zip(target.points[:60], binding.cells[:60], strict=True):
        edges = coarse.points[coarse.cells[:, 1:]] - coarse.points[coarse.cells[:, :1]]
        weights = np.linalg.solve(edges.transpose(0, 2, 1), (p - coarse.points[coarse.cells[:, 0]])[..., None])[..., 0]
        weights = np.column_stack([1 - weights.sum(axis=1), weights])
        assert home == np.flatnonzero(weights.min(axis=1) > -1e-11)[0]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("gap", [0.02, -0.05])
def test_never_across_bodies(d, gap):
    """Two boxes almost touching, or overlapping at rest; the fine ones stick out of the coarse ones into each other's
    coarse mesh.
    """
    side = np.eye(d)[0] * (1.0 + gap)
    fine = together(box(d, 6), box(d, 6, side, side + 1.0))
    coarse = together(box(d, 2, 0.1, 0.9), box(d, 2, side - 0.02, side + 0.8))
    space = LevelSpace(coarse, COMM)
    for binding in (bind(fine, space), closest_binding(fine, space)):
        np.testing.assert_array_equal(coarse.bodies[binding.cells], fine.point_bodies)
    nearest = closest_binding(level(fine.points, fine.cells), LevelSpace(level(coarse.points, coarse.cells), COMM))
    assert (coarse.bodies[nearest.cells] != fine.point_bodies).any(), "the scene tempts nobody"


def test_coarse_bodies_that_contain_no_fine_vertex():
    """One that crosses no fine edge has orphans. Of one that crosses some, the first rays decide for all points."""
    fine = together(box(2, 2), box(2, 2, 3.0, 4.0))
    needle = level(np.array([[0.30, 0.10], [0.36, 0.10], [0.33, 0.16]]), [[0, 1, 2]])
    binding = bind(fine, LevelSpace(together(needle, box(2, 1, 3.0, 4.0)), COMM))
    assert binding.report()["orphans"] == 9 and (binding.kind[:9] == CLOSEST).all() and (binding.cells[:9] == 0).all()
    assert (binding.kind[9:] == INSIDE).all()
    sliver = level(np.array([[0.1, 0.45], [0.9, 0.45], [0.5, 0.48]]), [[0, 1, 2]])
    report = bind(box(2, 6), LevelSpace(sliver, COMM)).report()
    assert report["inside"] == report["orphans"] == 0
    assert report["ray"] > 0 and report["neighbour"] > 0


def test_inside_neighbours_without_hits_give_the_nearest_layer(monkeypatch):
    """Without rays, points next to inside points follow the boundary that is reached through the coarse material."""
    fine, coarse, fine_branch, coarse_branch = comb_pair(2)
    binding = bind(fine, LevelSpace(coarse, COMM))
    nothing = lambda self, starts, ends: (np.full(len(starts), -1), np.full(len(starts), np.inf))
    monkeypatch.setattr(BoundarySearch, "first_hits", nothing)
    cells, kind = bind_outside(fine, coarse, np.where(binding.kind == INSIDE, binding.cells, -1))
    assert set(kind) == {INSIDE, NEIGHBOUR}
    home = coarse_branch[cells]
    assert not ((fine_branch >= 0) & (home >= 0) & (fine_branch != home)).any()


@pytest.mark.parametrize(("size", "flat"), [(1e-3, 1e-4), (1.0, 1.0), (1e3, 1e-4)])
def test_cells_of_any_size_and_shape_contain_their_points(size, flat):
    """The middle of each cell is in that cell, and what is outside by a hundred-thousandth of the size is outside."""
    mesh = box(3, 4)
    stretched = size * np.array([1.0, flat, 1.0])
    mesh = type(mesh)(mesh.points * stretched, mesh.cells, mesh.bodies, mesh.regions)
    centres = mesh.points[mesh.cells].mean(axis=1)
    space = LevelSpace(mesh, COMM)
    np.testing.assert_array_equal(containing_cells(centres, mesh.bodies, space), np.arange(len(centres)))
    assert (containing_cells(mesh.points, mesh.point_bodies, space) >= 0).all()
    beside = mesh.points[mesh.boundary].mean(axis=1)
    beside = beside[beside[:, 0] > (1.0 - 1e-9) * size] + [1e-5 * size, 0.0, 0.0]
    assert len(beside) == 32
    assert (containing_cells(beside, np.zeros(32, dtype=np.int32), space) == -1).all()


def test_levels_that_do_not_match():
    with pytest.raises(MeshError, match="body 1"):
        bind(together(box(2, 2), box(2, 2, 2.0, 3.0)), LevelSpace(box(2, 1), COMM))
    with pytest.raises(MeshError, match="3D"):
        bind(box(3, 1), LevelSpace(box(2, 1), COMM))


def bindings(comm, d):
    fine, coarse, _, _ = comb_pair(d)
    move = lambda mesh: type(mesh)(mesh.points + np.eye(d)[0] * 1.5, mesh.cells, mesh.bodies, mesh.regions)
    fine, coarse = LevelSpace(together(fine, move(fine)), comm), LevelSpace(together(coarse, move(coarse)), comm)
    binding, back = bind(fine, coarse), bind(coarse, fine)
    found = {}
    for name in INTERPOLANTS:
        prolongation = Prolongation(coarse, fine, binding, INTERPOLANTS[name])
        weights = prolongation.weights()
        found |= {f"{name}_{key}": getattr(weights, key) for key in ("indptr", "indices", "data")}
        found["prolonged_" + name] = prolongation.prolong(np.sin(3.0 * coarse.mesh.points))
    for way, bound in (("", binding), ("back_", back)):
        found |= {way + name: getattr(bound, name) for name in ("cells", "kind", "weights")}
    return found


@pytest.mark.mpi
@pytest.mark.parametrize("d", [2, 3])
def test_one_rank_and_two_agree(d):
    """Binding and weights of all interpolants are the same to the last bit, whatever the partition, and products with
    the matrices to round-off.
    """
    one, two = results_on((1, 2), bindings, d)
    assert {f"{name}_data" for name in INTERPOLANTS} < set(one)
    for name in one:
        tolerance = 1e-13 if name.startswith("prolonged") else 0.0
        np.testing.assert_allclose(one[name], two[name], rtol=0.0, atol=tolerance, err_msg=name)
