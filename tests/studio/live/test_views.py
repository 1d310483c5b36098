"""What a live page sees at first and after "Fit view", without a browser."""

import numpy as np

from pdvol.store.obstacles import write_obstacles
from pdvol.store.reader import open_run
from pdvol.studio.draw.camera import VIEW_ANGLE
from pdvol.studio.live.frames import view, whole_view


def beside(camera, points) -> float:
    """How far points (n, 2) [m] are beside the middle, in half widths of a picture as high as it is wide."""
    half = max(1.0, camera.aspect) * camera.distance * np.tan(np.radians(VIEW_ANGLE / 2))
    return float(np.abs((points - camera.focus[:2]) @ camera.right[:2]).max() / half)


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


def test_fit_view_sees_all_stored_states(flat_run):
    run = open_run(flat_run)
    for step in range(run.levels[0].steps):
        assert beside(whole_view(run), run.levels[0].positions(step)) < 1.0
