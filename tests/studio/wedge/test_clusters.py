"""Clusters of end states: runs that end in known places."""

import numpy as np
import pytest

import runs
from pdvol import open_run
from pdvol.store.writer import RunWriter
from pdvol.studio.wedge.clusters import clusters, end_state
from shapes import box


def ending(path, shift, steps=2, stored=2, turn=0.0, mesh=None):
    """A ball that is moved by `shift` [m] along x at its end and turned by `turn` [rad]; or another mesh."""
    mesh = runs.ball(2, 40, (0.0, 0.0)) if mesh is None else mesh
    info = {"scene": "made", "dt": 0.1, "steps": steps, "method": "direct", "parameters": {}, "versions": {}}
    with RunWriter.create(path, info, [mesh], ["ball"]) as run:
        for step in range(stored + 1):
            c, s = np.cos(turn * step / steps), np.sin(turn * step / steps)
            x = mesh.points @ np.array([[c, s], [-s, c]]) + [shift * step / steps, 0.0]
            run.write_state(0, step, x, {"level": 0, "step": step} if step else None)
    return open_run(path)


@pytest.fixture
def five(tmp_path):
    shifts = [0.0, 5.0, 0.05, 5.1, 0.02]
    return [ending(tmp_path / str(i), shift) for i, shift in enumerate(shifts)]


def test_groups_are_of_end_states(five, tmp_path):
    """Distances are in sizes of the body. Runs that ended early are in no group."""
    size = np.linalg.norm(np.ptp(five[0].levels[0].rest, axis=0))
    assert np.linalg.norm(end_state(five[0]) - end_state(five[1])) == pytest.approx(5.0 / size)
    short = ending(tmp_path / "short", 0.0, stored=1)
    other = ending(tmp_path / "other", 0.0, mesh=runs.ball(2, 90, (0.0, 0.0)))
    for chosen, groups in (
        (five, [0, 1, 0, 1, 0]),
        (five[::-1], [0, 1, 0, 1, 0]),
        (five[::2], [0, 0, 0]),
        (five[:1], [0]),
        ([five[0], short, five[1], None], [0, -1, 1, -1]),
        ([five[0], other, five[2]], [0, 1, 0]),
        ([short], [-1]),
        ([], []),
    ):
        assert clusters(chosen).tolist() == groups


def test_poses_of_one_place_are_groups_and_a_ball_has_none(tmp_path):
    """Bars that stand or lie on either side of a far gap, each a little off; balls that rolled as far."""
    ends = [(shift, turn) for shift in (0.0, 90.0) for turn in (0.0, 0.1, 1.5, 1.6)]
    bar = box(2, 4, [-0.5, -0.1], [0.5, 0.1])
    bars = [ending(tmp_path / f"bar{i}", end[0], turn=end[1], mesh=bar) for i, end in enumerate(ends)]
    balls = [ending(tmp_path / f"ball{i}", end[0], turn=end[1]) for i, end in enumerate(ends)]
    assert clusters(bars).tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert clusters(balls).tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
