"""XDMF as meshio and VTK (ParaView's reader) see it."""

import shutil

import meshio
import numpy as np
import pytest
import pyvista as pv

from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.export.xdmf import write_xdmf


@pytest.mark.parametrize("kind", ["flat_run", "solid_run"])
def test_meshio_and_vtk_read_every_step_also_after_a_move(kind, request, tmp_path):
    run = open_run(request.getfixturevalue(kind))
    level, d = run.levels[1], run.levels[1].rest.shape[1]
    (tmp_path / "here").mkdir()
    write_xdmf(run, 1, tmp_path / "here" / "level_1.xdmf")
    assert sorted(p.name for p in (tmp_path / "here").iterdir()) == ["level_1.h5", "level_1.xdmf"]
    shutil.move(tmp_path / "here", tmp_path / "there")
    path = tmp_path / "there" / "level_1.xdmf"

    with meshio.xdmf.TimeSeriesReader(path) as reader:
        points, cells = reader.read_points_cells()
        np.testing.assert_array_equal(points, level.rest)
        np.testing.assert_array_equal(cells[0].data, level.cells)
        assert reader.num_steps == level.steps
        for step in range(level.steps):
            time, point_data, cell_data = reader.read_data(step)
            assert time == pytest.approx(step * run.dt)
            np.testing.assert_array_equal(point_data["displacement"][:, :d], level.positions(step) - level.rest)
            np.testing.assert_array_equal(point_data["velocity"][:, :d], level.velocities(step))
            assert point_data["velocity"].shape[1] == 3 and not point_data["displacement"][:, d:].any()
            np.testing.assert_array_equal(cell_data["body"][0], level.bodies)
            np.testing.assert_array_equal(cell_data["region"][0], level.regions)

    reader = pv.XdmfReader(str(path))
    assert reader.number_time_points == level.steps
    reader.set_active_time_point(2)
    grid = reader.read()
    grid = grid.combine() if isinstance(grid, pv.MultiBlock) else grid
    assert grid.n_points == len(level.rest) and grid.n_cells == len(level.cells)
    np.testing.assert_allclose(grid.point_data["displacement"][:, :d], level.positions(2) - level.rest, atol=1e-7)


def test_an_unfinished_level_is_exported_as_far_as_it_is(small_run, tmp_path):
    (small_run / "levels" / "0" / "000004.npy").unlink()
    path = write_xdmf(open_run(small_run), 0, tmp_path / "new" / "level_0.xdmf")
    with meshio.xdmf.TimeSeriesReader(path) as reader:
        assert reader.num_steps == 4
    (small_run / "levels" / "0" / "000000.npy").unlink()
    with pytest.raises(InputError, match="no stored state"):
        write_xdmf(open_run(small_run), 0, path)
    with meshio.xdmf.TimeSeriesReader(path) as reader:
        assert reader.num_steps == 4
    with pytest.raises(InputError, match="levels 0 to 1, not 5"):
        write_xdmf(open_run(small_run), 5, path)
    with pytest.raises(InputError, match="ends in .xdmf"):
        write_xdmf(open_run(small_run), 1, tmp_path / "level.h5")
