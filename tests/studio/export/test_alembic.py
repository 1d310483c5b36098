"""Alembic files read back by Alembic's own library; `test_blender` reads them by Blender's."""

import sys

import numpy as np
import pytest

import runs
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.export.exports import export_run
from pdvol.studio.export.frames import even_frames

pytest.importorskip("alembic3d", reason="alembic3d is an optional extra")
from alembic3d.Abc import IArchive
from alembic3d.AbcGeom import IPolyMesh

FLOAT32 = 2e-7  # of a coordinate of a few metres, relative


def schemas(path) -> dict:
    """Of each mesh, by name."""
    top = IArchive(str(path)).getTop()
    places = [top.getChild(i) for i in range(top.getNumChildren())]
    return {place.getName(): IPolyMesh(place, place.getChild(0).getName()).getSchema() for place in places}


def points(schema, number: int) -> np.ndarray:
    return np.array([tuple(point) for point in schema.getPositionsProperty().getValue(number)])


def z_up(turned: np.ndarray) -> np.ndarray:
    """From Alembic's y upward to the scene's z upward."""
    return turned @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.mark.parametrize("fps", [None, 30.0])
def test_every_state_of_bodies_and_obstacles(fps, tmp_path):
    path = runs.stored_run(tmp_path / "run", 3, (60, 200), 5)
    written, notes = export_run(path, "alembic", tmp_path / "out", fps=fps)
    run = open_run(path)
    assert written == [tmp_path / "out" / f"level_{level.index}.abc" for level in run.levels] and notes == []
    rate = fps or 1 / run.dt
    frames = even_frames(6, run.dt, rate)
    for file, level in zip(written, run.levels, strict=True):
        found = schemas(file)
        assert set(found) == {"left", "right", "ground", "ball", "ball_1"}
        owners = level.mesh.point_bodies[level.surface[:, 0]]
        for body, name in enumerate(run.info["bodies"]):
            mine = level.surface[owners == body]
            used, faces = np.unique(mine, return_inverse=True)
            value = found[name].getValue(0)
            corners = np.array(list(value.getFaceIndices())).reshape(-1, 3)
            np.testing.assert_array_equal(corners[:, ::-1], faces.reshape(-1, 3))
            assert found[name].getNumSamples() == len(frames)
            for number, frame in enumerate(frames):
                expected = frame.sampled(level.positions)[used]
                np.testing.assert_allclose(z_up(points(found[name], number)), expected, rtol=FLOAT32, atol=1e-7)
                time = found[name].getTimeSampling().getSampleTime(number)
                assert time == pytest.approx(number / rate, abs=1e-9)
            places = np.array([points(found[name], number) for number in range(len(frames))])
            towards = np.diff(places, axis=0) * rate
            for number, expected in enumerate([*towards, towards[-1]]):
                velocities = found[name].getVelocitiesProperty().getValue(number)
                seen = np.array([tuple(velocity) for velocity in velocities])
                np.testing.assert_allclose(seen, expected, atol=1e-4, err_msg="towards the next sample")
        for number, frame in enumerate(frames):
            expected = frame.sampled(run.obstacles[2].vertices)
            np.testing.assert_allclose(z_up(points(found["ball_1"], number)), expected, rtol=FLOAT32, atol=1e-7)
        assert found["ground"].getNumSamples() == found["ball"].getNumSamples() == 1


def test_a_flat_run_stands_upright(flat_run, tmp_path):
    written, _ = export_run(flat_run, "alembic", tmp_path)
    run = open_run(flat_run)
    level = run.levels[0]
    found = points(schemas(written[0])["left"], 1)
    used = np.flatnonzero(level.mesh.point_bodies == 0)
    np.testing.assert_allclose(found[:, :2], level.positions(1)[used], rtol=FLOAT32, atol=1e-7)
    assert (found[:, 2] == 0).all()


def test_without_the_library(solid_run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "alembic3d", None)
    with pytest.raises(InputError, match="pip install alembic3d"):
        export_run(solid_run, "alembic", tmp_path)
