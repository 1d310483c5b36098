"""PC2 files and their meshes, read back by other means: the header by its description, OBJ by meshio."""

import struct

import meshio
import numpy as np
import pytest

import runs
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.export.exports import export_run
from pdvol.studio.export.frames import even_frames
from pdvol.studio.shown import PALETTE, linear_colour

FLOAT32 = 2e-7  # of a coordinate of a few metres, relative


def cache(path) -> np.ndarray:
    """(frames, points, 3) of a PC2 file."""
    data = path.read_bytes()
    name, version, points, first, rate, frames = struct.unpack_from("<12siiffi", data)
    assert (name, version, first, rate) == (b"POINTCACHE2\0", 1, 0.0, 1.0)
    assert len(data) == 32 + 12 * points * frames
    return np.frombuffer(data, "<f4", offset=32).reshape(frames, points, 3)


def boundary(level, body: int) -> np.ndarray:
    """A body's vertices on its surface, in the input's order."""
    facets = level.surface if level.rest.shape[1] == 3 else level.cells
    return np.unique(facets[level.mesh.point_bodies[facets[:, 0]] == body])


def in_space(vectors: np.ndarray) -> np.ndarray:
    return np.column_stack([vectors, np.zeros((len(vectors), 3 - vectors.shape[1]))])


@pytest.mark.parametrize("fps", [None, 50.0, 120.0])
@pytest.mark.parametrize("kind", ["flat_run", "solid_run"])
def test_every_frame_of_every_body(kind, fps, request, tmp_path):
    path = request.getfixturevalue(kind)
    written, notes = export_run(path, "pc2", tmp_path, fps=fps)
    run = open_run(path)
    assert written == [*(tmp_path / f"level_{level.index}" for level in run.levels), tmp_path / "open_in_blender.py"]
    assert notes == []
    rate = fps or 24.0
    for level in run.levels:
        for body, name in enumerate(run.info["bodies"]):
            used = boundary(level, body)
            mesh = meshio.read(tmp_path / f"level_{level.index}" / f"{name}.obj")
            np.testing.assert_array_equal(mesh.points, in_space(level.rest[used]))
            (block,) = mesh.cells
            facets = level.surface if level.rest.shape[1] == 3 else level.cells
            np.testing.assert_array_equal(used[block.data], facets[level.mesh.point_bodies[facets[:, 0]] == body])
            frames = cache(tmp_path / f"level_{level.index}" / f"{name}.pc2")
            last = (level.steps - 1) * run.dt
            assert len(frames) == int(last * rate + 1e-6) + 1
            for i, found in enumerate(frames):
                passed = i / rate / run.dt  # steps
                before = min(int(passed + 1e-6), level.steps - 2)
                share = passed - before
                expected = (1 - share) * level.positions(before) + share * level.positions(before + 1)
                np.testing.assert_allclose(found, in_space(expected[used]), rtol=FLOAT32, atol=1e-7)


def test_obstacles_move_only_where_they_do(tmp_path):
    path = runs.stored_run(tmp_path / "run", 3, (60,), 5)
    export_run(path, "pc2", tmp_path / "out")
    run, folder = open_run(path), tmp_path / "out" / "level_0"
    assert {file.stem for file in folder.glob("*.obj")} == {"left", "right", "ground", "ball", "ball_1"}
    assert {file.stem for file in folder.glob("*.pc2")} == {"left", "right", "ball_1"}
    rising = run.obstacles[2]
    frames = even_frames(6, run.dt, 24.0)
    for frame, found in zip(frames, cache(folder / "ball_1.pc2"), strict=True):
        np.testing.assert_allclose(found, frame.sampled(rising.vertices), rtol=FLOAT32, atol=1e-7)
    resting = meshio.read(folder / "ball.obj")
    np.testing.assert_array_equal(resting.points, run.obstacles[1].vertices(0))
    np.testing.assert_array_equal(resting.cells_dict["triangle"], run.obstacles[1].arrays["faces"])
    assert meshio.read(folder / "ground.obj").cells_dict["quad"].tolist() == [[0, 1, 2, 3]]


def test_colours_are_those_of_pictures(solid_run, tmp_path):
    export_run(solid_run, "pc2", tmp_path, levels=[0])
    lines = (tmp_path / "level_0" / "materials.mtl").read_text().splitlines()
    colours = dict(zip(lines[::4], lines[1::4], strict=True))
    for name, code in zip(("left", "right"), PALETTE, strict=False):
        found = [float(word) for word in colours[f"newmtl {name}"].split()[1:]]
        np.testing.assert_allclose(found, linear_colour(code), atol=1e-6)


def test_a_rate_that_is_no_number_of_frames(solid_run, tmp_path):
    with pytest.raises(InputError, match="--fps 0: choose a number"):
        export_run(solid_run, "pc2", tmp_path / "out", fps=0.0)
    assert not (tmp_path / "out").exists()


def test_the_folder_of_an_earlier_export_is_overwritten(solid_run, tmp_path):
    export_run(solid_run, "pc2", tmp_path, levels=[0], fps=24.0)
    first = (tmp_path / "level_0" / "left.pc2").stat().st_size
    export_run(solid_run, "pc2", tmp_path, levels=[0], fps=240.0)
    assert (tmp_path / "level_0" / "left.pc2").stat().st_size > 4 * first
    assert not [file for file in (tmp_path / "level_0").iterdir() if file.name.startswith(".")]
