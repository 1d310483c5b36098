"""Between the frames of a USD file: where OpenUSD's own library puts a mesh's points by their velocities."""

from itertools import pairwise

import numpy as np
import pytest

import runs
from exported import write_usd
from pdvol.store.reader import open_run
from pdvol.studio.export.frames import even_frames, points_and_velocities, stored_frames

pytest.importorskip("pxr", reason="usd-core is an optional extra")
from pxr import Usd, UsdGeom

FLOAT32 = 2e-6  # m: positions of a few metres, moved by velocities of a few metres a second
MOVING = ("bodies/left", "bodies/right", "obstacles/ball_1")


def moved(mesh: UsdGeom.Mesh, time: float) -> np.ndarray:
    return np.array(mesh.ComputePointsAtTime(Usd.TimeCode(time), Usd.TimeCode(time)))


@pytest.mark.parametrize("fps", [None, 24.0, 30.0, 125.0])
def test_points_between_frames_lie_on_the_way_to_the_next_one(fps, solid_run, tmp_path):
    run = open_run(solid_run)
    stage = Usd.Stage.Open(str(write_usd(run, [0], tmp_path / "a", fps)))
    steps = run.levels[0].steps
    codes = [frame.code for frame in (stored_frames(steps, run.dt) if fps is None else even_frames(steps, run.dt, fps))]
    assert len(codes) > 1
    for place in MOVING:
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/run/{place}"))
        attribute = mesh.GetPointsAttr()
        assert attribute.GetTimeSamples() == mesh.GetVelocitiesAttr().GetTimeSamples() == codes
        covered = 0.0
        for start, end in pairwise(codes):
            ends = np.array(attribute.Get(start)), np.array(attribute.Get(end))
            covered = max(covered, abs(ends[1] - ends[0]).max())
            for share in (0.25, 0.5, 0.999):
                time = start + share * (end - start)
                np.testing.assert_allclose(moved(mesh, time), (1 - share) * ends[0] + share * ends[1], atol=FLOAT32)
        assert covered > 1e3 * FLOAT32, "it moves"
        last, past = codes[-2:], codes[-1] + 0.5 * (codes[-1] - codes[-2])
        ends = [np.array(attribute.Get(code)) for code in last]
        np.testing.assert_allclose(moved(mesh, past), ends[1] + 0.5 * (ends[1] - ends[0]), atol=FLOAT32)


def test_each_state_is_asked_for_once_and_one_frame_alone_has_no_velocities():
    asked = []

    def at(step: int) -> np.ndarray:
        asked.append(step)
        return np.full((2, 3), float(step**2))

    track = list(points_and_velocities(stored_frames(4, 0.5), at, 24.0))
    assert asked == [0, 1, 2, 3]
    assert [points[0, 0] for points, _ in track] == [0, 1, 4, 9]
    assert [velocities[0, 0] for _, velocities in track] == pytest.approx([2, 6, 10, 10])
    ((points, velocities),) = points_and_velocities(stored_frames(1, 0.5), at, 24.0)
    assert points.shape == (2, 3) and velocities is None


def test_a_run_of_one_state_is_a_still(tmp_path):
    path = write_usd(open_run(runs.stored_run(tmp_path / "run", 3, (60,), 0)), [0], tmp_path / "a")
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/run/bodies/left"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 0)
    assert mesh.GetPointsAttr().GetTimeSamples() == [0] and not mesh.GetVelocitiesAttr().HasValue()
