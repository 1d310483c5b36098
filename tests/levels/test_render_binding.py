"""Surfaces that follow a level: affine motions, seams, branches, and no wild extrapolation, by every interpolant."""

import numpy as np
import pytest

from pdvol import meshes
from pdvol.errors import InputError
from pdvol.geometry.halved_cells import halved
from pdvol.geometry.nearest_in_simplex import nearest_coordinates
from pdvol.meshes import RenderSurface
from pdvol.meshing.tetrahedralise import tetrahedralise
from pdvol.meshing.weld import coincident
from pdvol.registry import INTERPOLANTS
from pdvol.runs import render_binding
from pdvol.runs.render_binding import render_weights
from shapes import box, grid, level

MAP, SHIFT = np.array([[1.2, 0.3, -0.1], [-0.2, 0.9, 0.4], [0.1, -0.3, 1.1]]), np.array([0.3, -2.0, 5.0])


def ball(radius=0.5, rings=24) -> RenderSurface:
    """A ball of quadrilaterals about (1/2, 1/2, 1/2), with one seam and two poles."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, 2 * rings + 1), np.linspace(0.0, 1.0, rings + 1), indexing="ij")
    a, b = 2 * np.pi * u.ravel(), np.pi * v.ravel()
    points = 0.5 + radius * np.column_stack([np.sin(b) * np.cos(a), np.sin(b) * np.sin(a), np.cos(b)])
    i, j = (k.ravel() for k in np.meshgrid(np.arange(2 * rings), np.arange(rings), indexing="ij"))
    at = lambda p, q: p * (rings + 1) + q
    # Vertices of the seam and of the poles are there more than once, as in files of many games.
    faces = np.column_stack([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)])
    return RenderSurface.of(points, faces, np.column_stack([u.ravel(), v.ravel()]))


def weights_of(surface, body, interpolant):
    first = coincident(surface.vertices, 1e-9)
    return render_weights(surface.vertices, surface.triangles, first, body, interpolant, "body 'x'")


@pytest.mark.parametrize("interpolant", sorted(INTERPOLANTS))
@pytest.mark.parametrize("boxes", [2, 5])
def test_affine_motions_are_reproduced_also_outside(interpolant, boxes):
    """And vertices at one place stay together in any motion."""
    body, surface = box(3, boxes, jitter=0.1), ball(0.6)
    w, first = weights_of(surface, body, interpolant), coincident(surface.vertices, 1e-9)
    outside = np.abs(surface.vertices - 0.5).max(axis=1) > 0.55
    assert outside.sum() > 100 and (~outside).sum() > 100 and (first != np.arange(len(first))).sum() > 60
    np.testing.assert_allclose(w @ (body.points @ MAP.T + SHIFT), surface.vertices @ MAP.T + SHIFT, atol=1e-9)
    np.testing.assert_allclose(w.sum(axis=1), 1.0, atol=1e-12)
    moved = w @ np.random.default_rng(0).normal(size=body.points.shape)
    np.testing.assert_array_equal(moved, moved[first])


def test_a_large_area_outside_is_bound_to_what_is_below_it():
    """A plate 0.1 above a slab of slivers, which meets it at one of its ends: each vertex follows the part below."""
    slab = grid(np.linspace(0, 2, 9), np.linspace(0, 1, 5), [0.0, 0.02, 0.5], jitter=0.1)
    x, y = np.meshgrid(np.linspace(0.02, 1.98, 80), np.linspace(0.05, 0.95, 30), indexing="ij")
    height = 0.6 - 0.2 * (x < 0.1)  # dips into the slab there
    plate = np.column_stack([x.ravel(), y.ravel(), height.ravel()])
    i, j = (k.ravel() for k in np.meshgrid(np.arange(79), np.arange(29), indexing="ij"))
    faces = np.column_stack([i * 30 + j, (i + 1) * 30 + j, (i + 1) * 30 + j + 1, i * 30 + j + 1])
    w = weights_of(RenderSurface.of(plate, faces), slab, "phong")
    assert np.abs(w.data).max() < 3.0
    far = np.abs(slab.points[w.tocoo().col, 0] - plate[w.tocoo().row, 0])
    assert far[np.abs(w.tocoo().data) > 1e-6].max() < 0.8, "further than the cells around the nearest facet"


def test_a_surface_does_not_jump_to_another_branch():
    """Two prongs with a narrow slit between them, and a sheath of one that lies beyond the middle of the slit."""
    ticks = [0.0, 1.0, 1.04, 2.04], [0.0, 1.0], np.linspace(0, 3, 7)
    prongs = grid(*ticks, keep=lambda i, j, k: i != 1 or k == 0)
    sheath = box(3, 8, (0.1, 0.1, 1.0), (1.035, 0.9, 2.9))
    used, faces = np.unique(sheath.boundary, return_inverse=True)
    surface = RenderSurface.of(sheath.points[used], faces.reshape(-1, 3))
    apart = prongs.points.copy()
    second = (apart[:, 0] > 1.02) & (apart[:, 2] > 0.5)
    apart[second] += [5.0, 0.0, 0.0]
    for interpolant in ("barycentric", "phong"):
        moved = weights_of(surface, prongs, interpolant) @ apart
        high = surface.vertices[:, 2] > 1.2
        np.testing.assert_allclose(moved[high], surface.vertices[high], atol=1e-9)


@pytest.fixture(scope="module")
def dough():
    solid = tetrahedralise(meshes.donut(0.3, 0.13, 32, 16), 400, "donut")
    return level(solid.points, solid.cells)


@pytest.mark.parametrize("interpolant", sorted(INTERPOLANTS))
def test_noise_of_the_level_is_not_amplified(dough, interpolant):
    """The rule of finer levels gives weights up to 40 here; single edges are then stretched by a factor of 44."""
    w = weights_of(meshes.donut_render(0.3, 0.13, 96, 48), dough, interpolant)
    assert np.abs(w.data).max() < 2.0 and np.abs(w).sum(axis=1).max() < 3.0


def test_the_limit_of_biharmonic_weights_is_named(dough, monkeypatch):
    monkeypatch.setattr(render_binding, "MOST_HALVED", 100)
    with pytest.raises(InputError, match=r"body 'x': biharmonic weights of a render mesh need .*interpolant='phong'"):
        weights_of(meshes.donut_render(segments=16, around=8), dough, "biharmonic")


# ---- geometry behind it


def test_nearest_point_of_a_simplex_by_brute_force():
    rng = np.random.default_rng(3)
    corners = rng.normal(size=(40, 4, 3))
    points = 2.0 * rng.normal(size=(40, 3))
    w = nearest_coordinates(points, corners)
    assert w.min() >= 0.0
    np.testing.assert_allclose(w.sum(axis=1), 1.0)
    found = np.linalg.norm(np.einsum("nc,ncd->nd", w, corners) - points, axis=1)
    samples = rng.dirichlet(0.3 * np.ones(4), 20_000)
    best = np.array([np.linalg.norm(samples @ c - p, axis=1).min() for c, p in zip(corners, points, strict=True)])
    assert (found <= best + 1e-12).all() and (best - found < 0.15).all()
    inside = np.einsum("nc,ncd->nd", rng.dirichlet(np.ones(4), 40), corners)
    np.testing.assert_allclose(
        np.einsum("nc,ncd->nd", nearest_coordinates(inside, corners), corners), inside, atol=1e-12
    )


@pytest.mark.parametrize("d, line", [(2, 0), (3, 0), (3, 1)])
def test_halved_cells_fill_the_same_volume(d, line):
    body = box(d, 2, jitter=0.2)
    points, cells = halved(body.points, body.cells, line)
    fine = level(points, cells)
    assert len(fine.cells) == 2**d * len(body.cells) and fine.volumes.min() > 0.0
    parts = fine.volumes.reshape(-1, 2**d)
    np.testing.assert_allclose(parts, np.repeat(body.volumes[:, None] / 2**d, 2**d, axis=1), rtol=1e-11)
    np.testing.assert_array_equal(fine.points[: len(body.points)], body.points)
    assert len(np.unique(points.round(9), axis=0)) == len(points)
    assert len(fine.boundary) == 2 ** (d - 1) * len(body.boundary), "cells do not meet face to face"
