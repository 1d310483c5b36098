"""Each format, read back by an independent library, over the same two runs."""

import sys

import meshio
import numpy as np
import pytest
import pyvista as pv

import runs
from exported import READERS
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.export.exports import export_run
from pdvol.studio.export.xdmf import write_xdmf
from pdvol.studio.shown import PALETTE, linear_colour

RESAMPLED = {"usd", "pc2", "alembic"}  # these take --fps, and have obstacles
CASES = [(kind, None) for kind in READERS] + [(kind, 120.0) for kind in sorted(RESAMPLED)]
NAMES = {"flat_run": {"ground", "spike", "wire"}, "solid_run": {"ground", "ball", "ball_1"}}


def in_space(vectors: np.ndarray) -> np.ndarray:
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def near(found, expected, kind: str) -> None:
    """Equal, as far as the format's numbers hold them."""
    float32 = kind in RESAMPLED
    np.testing.assert_allclose(found, expected, rtol=1e-7 if float32 else 0, atol=1e-9 if float32 else 1e-15)


@pytest.mark.parametrize("stored", NAMES)
@pytest.mark.parametrize(("kind", "fps"), CASES)
def test_all_parts_at_all_frames(kind, fps, stored, request, tmp_path):
    path = request.getfixturevalue(stored)
    flat, run = stored == "flat_run", open_run(path)
    written, notes = export_run(path, kind, tmp_path / "first", fps=fps)
    assert not list(tmp_path.rglob(".*"))
    (tmp_path / "first").rename(tmp_path / "moved")  # files name each other by relative paths
    written = [tmp_path / "moved" / file.name for file in written]
    assert all(file.exists() for file in written)
    assert bool(notes) == (kind == "xdmf"), "no other format asks for the run's scene"
    rate = fps or (24.0 if kind == "pc2" else 1.0 / run.dt)
    for level in run.levels:
        found = READERS[kind](written, level.index, fps, flat)
        assert set(found) == {"left", "right"} | (NAMES[stored] if kind in RESAMPLED else set())
        last = level.steps - 1
        times = np.arange(int(last * run.dt * rate + 1e-6) + 1) / rate

        def between(at, time, last=last):
            step = min(int(time / run.dt + 1e-6), last - 1)
            share = time / run.dt - step
            return in_space((1 - share) * at(step) + share * at(step + 1))

        moving = {}
        cells = level.cells if flat or kind == "xdmf" else level.surface
        for body, name in enumerate(("left", "right")):
            mine = cells[level.mesh.point_bodies[cells[:, 0]] == body]
            order = (np.unique(corners, return_inverse=True)[1] for corners in (found[name].corners, mine))
            np.testing.assert_array_equal(*map(np.ravel, order), err_msg="once each, in the input's order")
            moving[name] = (mine, level.positions)
        if "ball_1" in found:
            moving["ball_1"] = (run.obstacles[2].arrays["faces"], run.obstacles[2].vertices)
        for name, (corners, at) in moving.items():
            seen = found[name]
            assert len(seen.points) == len(times)
            if kind != "obj":
                np.testing.assert_allclose(seen.times, times, atol=1e-9)
            for points, time in zip(seen.points, times, strict=True):
                near(points[seen.corners], between(at, time)[corners], kind)
            if kind == "xdmf":
                near(seen.velocities, [in_space(level.velocities(step)) for step in range(level.steps)], kind)
            elif seen.velocities is not None:
                towards = np.diff([between(at, time)[corners] for time in times], axis=0) * rate
                speeds = seen.velocities[:, seen.corners]
                np.testing.assert_allclose(speeds, [*towards, towards[-1]], rtol=1e-6, atol=1e-6)
        for name in set(found) - set(moving):
            assert len(found[name].points) == 1, "it rests"
        if kind in RESAMPLED:
            resting, shape = found["spike" if flat else "ball"], run.obstacles[1]
            near(resting.points[0], in_space(shape.vertices(0)), kind)
            np.testing.assert_array_equal(np.sort(resting.corners), np.sort(shape.arrays.get("faces", [[0, 1, 2]])))
            ground, up = found["ground"], 1 if flat else 2
            (quad,) = ground.points
            assert ground.corners.tolist() == [[0, 1, 2, 3]] and np.allclose(quad[:, up].max(), -0.01)
            states = np.concatenate([in_space(level.positions(step)) for step in range(level.steps)])
            for axis in {0, 1} - {up}:
                assert quad[:, axis].min() < states[:, axis].min() < states[:, axis].max() < quad[:, axis].max()


@pytest.mark.parametrize("stored", NAMES)
def test_vtk_reads_xdmf(stored, request, tmp_path):
    """As ParaView does."""
    run = open_run(request.getfixturevalue(stored))
    (_, path, _), _ = export_run(run.path, "xdmf", tmp_path)
    assert {file.name for file in tmp_path.glob("level_1*")} == {"level_1.h5", "level_1.xdmf"}
    level, reader = run.levels[1], pv.XdmfReader(str(path))
    d = level.rest.shape[1]
    assert reader.number_time_points == level.steps
    reader.set_active_time_point(2)
    grid = reader.read()
    grid = grid.combine() if isinstance(grid, pv.MultiBlock) else grid
    assert grid.n_points == len(level.rest) and grid.n_cells == len(level.cells)
    np.testing.assert_allclose(grid.point_data["displacement"][:, :d], level.positions(2) - level.rest, atol=1e-7)
    np.testing.assert_array_equal(grid.cell_data["body"], level.bodies)
    np.testing.assert_array_equal(grid.cell_data["region"], level.regions)


@pytest.mark.parametrize(
    ("kind", "package", "name"), [("usd", "pxr", "usd-core"), ("alembic", "alembic3d", "alembic3d")]
)
def test_without_the_library(kind, package, name, solid_run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=f"pip install {name}"):
        export_run(solid_run, kind, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("kind", "choices", "said"),
    [
        ("obj", {"fps": 24.0}, "--fps: the format obj holds the stored steps alone"),
        ("xdmf", {"surface": "both"}, "--surface: the format xdmf holds the simulated mesh alone"),
        ("pc2", {"with_fields": True}, "--fields: the format pc2 has no such choice"),
        *((kind, {"fps": 0.0}, "--fps 0: choose a number") for kind in sorted(RESAMPLED)),
        ("vtkhdf", {}, "choose one of xdmf"),
    ],
)
def test_choices_that_a_format_does_not_take_are_named(kind, choices, said, solid_run, tmp_path):
    with pytest.raises(InputError, match=said):
        export_run(solid_run, kind, tmp_path / "out", **choices)
    assert not (tmp_path / "out").exists()


def test_an_unfinished_level_is_exported_as_far_as_it_is(small_run, tmp_path):
    runs.keep_states(small_run / "levels" / "0", 4)
    path = write_xdmf(open_run(small_run), 0, tmp_path / "new" / "level_0.xdmf")
    with meshio.xdmf.TimeSeriesReader(path) as reader:
        assert reader.num_steps == 4
    runs.keep_states(small_run / "levels" / "0", 0)
    with pytest.raises(InputError, match="no stored state"):
        write_xdmf(open_run(small_run), 0, path)
    with meshio.xdmf.TimeSeriesReader(path) as reader:
        assert reader.num_steps == 4
    with pytest.raises(InputError, match="levels 0 to 1, not 5"):
        write_xdmf(open_run(small_run), 5, path)
    with pytest.raises(InputError, match="ends in .xdmf"):
        write_xdmf(open_run(small_run), 1, tmp_path / "level.h5")


@pytest.mark.parametrize("kind", ["pc2", "obj"])
def test_colours_are_those_of_pictures(kind, solid_run, tmp_path):
    export_run(solid_run, kind, tmp_path, levels=[0])
    lines = (tmp_path / "level_0" / "materials.mtl").read_text().splitlines()
    colours = dict(zip(lines[::4], lines[1::4], strict=True))
    for name, code in zip(("left", "right"), PALETTE, strict=False):
        found = [float(word) for word in colours[f"newmtl {name}"].split()[1:]]
        np.testing.assert_allclose(found, linear_colour(code), atol=1e-6)
