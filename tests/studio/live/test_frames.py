"""What a live page is sent of a stored state."""

import base64
import zlib

import numpy as np
import pytest

from pdvol.store.reader import open_run
from pdvol.studio.live.frames import WIDTH, Frames, view


def unpacked(scene, number):
    """An array of a scene's chunks."""
    entry, text = scene["chunks"][number], scene["texts"][number]
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype=entry["type"]).reshape(entry["shape"])


def rows_of(frames, step):
    return np.frombuffer(frames.places(step), dtype="<f4").reshape(-1, WIDTH)


@pytest.mark.parametrize("name, dim", [("flat_run", 2), ("solid_run", 3)])
def test_bodies_are_at_their_stored_positions(name, dim, request):
    run = open_run(request.getfixturevalue(name))
    for index, level in enumerate(run.levels):
        frames = Frames(run, index)
        scene = frames.scene()
        pane = scene["pane"]
        faces, bodies = (unpacked(scene, pane[key]) for key in ("faces", "bodies"))
        facets = level.surface if dim == 3 else level.cells
        assert faces.shape == facets.shape and len(pane["obstacles"]) == len(run.obstacles) > 0
        np.testing.assert_array_equal(bodies[faces[:, 0]], level.mesh.point_bodies[facets[:, 0]])
        rows = rows_of(frames, 2)
        np.testing.assert_allclose(rows[faces][..., :dim], level.positions(2)[facets], rtol=0, atol=1e-6)
        assert not rows[:, dim:].any()
        start = unpacked(scene, pane["positions"])
        np.testing.assert_array_equal(start[0], rows_of(frames, 0)[: len(bodies)])


def test_a_moving_obstacle_moves(solid_run):
    run = open_run(solid_run)
    frames, last = Frames(run, 0), run.levels[0].steps - 1
    scene = frames.scene()
    moving = [i for i, obstacle in enumerate(scene["pane"]["obstacles"]) if obstacle["moving"]]
    assert moving == [i for i, obstacle in enumerate(run.obstacles) if "positions" in obstacle.arrays]
    after = len(unpacked(scene, scene["pane"]["bodies"]))
    first, end = rows_of(frames, 0)[after:], rows_of(frames, last)[after:]
    np.testing.assert_allclose(end[:, :3], run.obstacles[moving[0]].vertices(last), atol=1e-6)
    assert not np.allclose(first, end)


def test_the_view_holds_bodies_and_what_is_below_them(solid_run):
    run = open_run(solid_run)
    camera = view(run)
    points = run.levels[0].positions(0)
    across = (points - camera.focus) @ np.column_stack([camera.right, camera.up])
    assert (np.abs(across).max(axis=0) <= camera.half_height * np.array([camera.aspect, 1.0])).all()
