"""Decimation keeps a surface closed, free of crossings, and of the same shape and topology."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from pdvol import meshes
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.meshes import Surface
from pdvol.meshing.decimate import _attempts, decimate, topology
from pdvol.meshing.validate import check_surface


@pytest.mark.parametrize("target", [300, 20])
def test_a_ball(target):
    ball = meshes.ball(1.0, 3)
    assert decimate(ball, len(ball.vertices)) is ball
    coarse = check_surface(decimate(ball, target))
    assert len(coarse.vertices) == pytest.approx(target, rel=0.2)
    assert topology(coarse.triangles, len(coarse.vertices)) == (1, 2)
    # An inscribed polyhedron of n vertices lacks about 2 pi sqrt(3) / (n - 2) of the volume; quadrics lie between it
    # and the circumscribed.
    assert enclosed_volume(coarse.vertices, coarse.triangles) == pytest.approx(4 * np.pi / 3, rel=11.0 / (target - 2))


def test_a_chain_of_levels_of_a_thin_shape():
    surface = meshes.creature()
    for target in (1500, 500, 150):
        surface = decimate(surface, target)
        assert len(surface.vertices) == pytest.approx(target, rel=0.2)
        assert topology(surface.triangles, len(surface.vertices)) == (1, 2)


def test_surfaces_decimated_side_by_side():
    """fast-simplification works on global variables: threads that interleave gave one of them another's surface, in
    half of all calls.
    """
    ball, targets = meshes.ball(0.5, 5), (100, 300, 900)
    alone = {target: decimate(ball, target).vertices for target in targets}
    with ThreadPoolExecutor(4) as pool:
        for target, made in pool.map(lambda target: (target, decimate(ball, target)), targets * 5):
            np.testing.assert_array_equal(made.vertices, alone[target])


def test_every_attempt_decimates():
    attempts = list(_attempts(meshes.ball(0.5, 4), 200, 2))
    assert len(attempts) == 6
    for points, triangles in attempts:
        made = check_surface(Surface(points, triangles), "ball")
        assert len(made.vertices) == pytest.approx(200, rel=0.25)
        assert topology(made.triangles, len(made.vertices)) == (1, 2)
