"""What a live page is sent of a stored state, and what it sees at first and after "Fit view"; without a browser."""

import base64
import zlib

import numpy as np
import pytest

from pdvol.store.obstacles import write_obstacles
from pdvol.store.reader import open_run
from pdvol.studio.draw.camera import VIEW_ANGLE
from pdvol.studio.live.frames import WIDTH, Frames, view, whole_view


def unpacked(scene, number):
    """An array of a scene's chunks."""
    entry, text = scene["chunks"][number], scene["texts"][number]
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype=entry["type"]).reshape(entry["shape"])


@pytest.mark.parametrize("name", ["flat_run", "solid_run"])
def test_bodies_and_obstacles_are_at_their_stored_positions(name, request):
    run = open_run(request.getfixturevalue(name))
    for index, level in enumerate(run.levels):
        dim, frames = level.rest.shape[1], Frames(run, index)
        rows = [np.frombuffer(frames.places(step), dtype="<f4").reshape(-1, WIDTH) for step in range(level.steps)]
        pane = (scene := frames.scene())["pane"]
        faces, bodies, start = (unpacked(scene, pane[key]) for key in ("faces", "bodies", "positions"))
        facets = level.surface if dim == 3 else level.cells
        assert faces.shape == facets.shape and len(pane["obstacles"]) == len(run.obstacles) > 0
        np.testing.assert_array_equal(bodies[faces[:, 0]], level.mesh.point_bodies[facets[:, 0]])
        np.testing.assert_allclose(rows[2][faces][..., :dim], level.positions(2)[facets], rtol=0, atol=1e-6)
        np.testing.assert_array_equal(start[0], rows[0][: len(bodies)])
        assert not rows[2][: len(bodies), dim:].any()
        moving = [i for i, obstacle in enumerate(pane["obstacles"]) if obstacle["moving"]]
        assert moving == [i for i, obstacle in enumerate(run.obstacles) if "positions" in obstacle.arrays]
        for step in (0, level.steps - 1) if moving else ():
            there = run.obstacles[moving[0]].vertices(step)
            np.testing.assert_allclose(rows[step][len(bodies) :, :3], there, atol=1e-6)


def beside(camera, points) -> float:
    """How far points (n, d) [m] are beside the middle, in half widths of a picture as high as it is wide."""
    half = max(1.0, camera.aspect) * camera.distance * np.tan(np.radians(VIEW_ANGLE / 2))
    d = points.shape[1]
    return float(np.abs((points - camera.focus[:d]) @ camera.right[:d]).max() / half)


def test_the_first_view_has_the_obstacles_that_the_shot_goes_to(small_run):
    """A box at three diagonals of the bodies is seen whole; a floor of many is not, so that bodies stay large."""
    positions = open_run(small_run).levels[0].positions(0)
    low, high = positions.min(axis=0), positions.max(axis=0)
    size = float(np.linalg.norm(high - low))
    edges = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    box, floor = high + [3.0 * size, 0.0] + 0.5 * size * corners, low + 100 * size * (corners - 0.5)
    entries = [{"name": n, "kind": "polyline", "vertices": v, "edges": edges} for n, v in (("b", box), ("f", floor))]
    write_obstacles(small_run, entries[:1])
    assert beside(view(open_run(small_run)), box) < 1.0
    write_obstacles(small_run, entries)
    assert beside(view(open_run(small_run)), positions) > 0.1


@pytest.mark.parametrize("name", ["flat_run", "solid_run"])
def test_views_hold_the_bodies(name, request):
    run = open_run(request.getfixturevalue(name))
    states = [run.levels[0].positions(step) for step in range(run.levels[0].steps)]
    assert max(beside(whole_view(run), x) for x in states) < 1.0
    camera, d = view(run), states[0].shape[1]
    across = (states[0] - camera.focus[:d]) @ np.column_stack([camera.right[:d], camera.up[:d]])
    assert (np.abs(across).max(axis=0) <= camera.half_height * np.array([camera.aspect, 1.0])).all()
