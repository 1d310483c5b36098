"""Runs of bodies that start away from rest: stored, resumed, side by side, checked, exported."""

import shutil
import subprocess

import numpy as np
import pytest

import runs
from cli_scenes import SQUARE, pdvol, states, write
from commands import SAFETY, WITHOUT_PICTURE
from pdvol import open_run
from pdvol.measure.verify import verify_run

STEPS = 8
BENT = (
    SQUARE
    + f"""

def scene(turn=1.0, mirror=1.0, hold=0.05, steps={STEPS}):
    def bent(X):
        \"\"\"A part of a ring, open upward.\"\"\"
        radius, angle = 1.0 / turn + 0.5 - X[:, 1], turn * (X[:, 0] - 0.5)
        return np.column_stack([mirror * radius * np.sin(angle), 1.0 / turn - radius * np.cos(angle)])

    bodies = (Body((square(3), square(6)), NeoHookean(2e4), name="clip", start=bent),
              Body((square(2), square(4)), NeoHookean(2e4), name="box", placement=Placement(translate=(-0.5, 0.65))))
    return Scene(bodies, dt=0.02, steps=steps, loads=(pdvol.Gravity((0.0, -9.81)),), contact=(Barrier(), Friction(0.3)),
                 supports=(Support(lambda X: X[:, 0] < 1e-9, body="clip", release=hold),),
                 obstacles=(Plane((0.0, -0.7), (0.0, 1.0)),))
"""
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("started")
    write(made / "bent.py", BENT)
    assert run(made, "whole") == 0
    return made


def run(folder, name, *words):
    return pdvol("run", folder / "bent.py", "--out", folder / name, "--no-picture", "--no-xdmf", *words)


def test_states_begin_bent_and_are_sound(folder):
    stored = open_run(folder / "whole")
    assert verify_run(folder / "whole") == []
    for level in stored.levels:
        clip = level.mesh.point_bodies == 0
        assert level.steps == STEPS + 1
        begin = level.positions(0)
        assert begin[clip, 1].min() < 0.0 < np.abs(begin - level.rest)[clip].max()
        np.testing.assert_array_equal(begin[~clip], level.rest[~clip])
        held = clip & (level.rest[:, 0] < 1e-9)
        np.testing.assert_array_equal(level.positions(2)[held], begin[held])  # where it starts, not where it rests
        assert np.abs(level.positions(STEPS)[held] - begin[held]).max() > 1e-3
    coarse, fine = stored.levels
    begins = [[level.positions(0)[i] for i in np.lexsort(level.rest.T)[[0, -1]]] for level in (coarse, fine)]
    np.testing.assert_allclose(*begins, atol=1e-12)


@pytest.mark.parametrize(("level", "step"), [(0, 0), (0, 3), (1, 0), (1, 4)])
def test_resumed_it_repeats_to_the_last_bit(folder, tmp_path, level, step):
    out = shutil.copytree(folder / "whole", tmp_path / "run")
    for later in range(level, 2):
        runs.keep_states(out / "levels" / str(later), step + 1 if later == level else 0)
    assert pdvol("run", folder / "bent.py", "--out", out, "--no-picture", "--no-xdmf", "--resume") == 0
    assert [states(out, k) for k in (0, 1)] == [states(folder / "whole", k) for k in (0, 1)]


def test_side_by_side_it_repeats_to_the_last_bit(folder):
    words = [*WITHOUT_PICTURE, "run", "bent.py", "--no-xdmf", "--out", "side", "--wavefront"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=SAFETY)
    assert done.returncode == 0, done.stderr
    assert [states(folder / "side", k) for k in (0, 1)] == [states(folder / "whole", k) for k in (0, 1)]


def test_another_start_is_not_resumed_and_no_branch_either(folder, capsys):
    assert run(folder, "whole", "--resume", "--set", "turn=0.9") == 2
    assert "bodies[0].start" in capsys.readouterr().err
    assert run(folder, "branched", "--branch", folder / "whole", "--at", 3, "--set", "turn=0.9") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "cannot go on from step 3 with another start" in line and not (folder / "branched").exists()


def test_a_start_inside_out_ends_in_one_line_and_nothing_is_written(folder, capsys):
    assert run(folder, "mirrored", "--set", "mirror=-1") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "level 0: the start of body 'clip' turns 18 of 18 cells inside out or flat" in line
    assert not (folder / "mirrored").exists()
    assert pdvol("check", folder / "bent.py", "--set", "mirror=-1") == 2
    said = capsys.readouterr()
    assert "defect at level 1: level 1: the start of body 'clip' turns 72 of 72 cells" in said.out + said.err


def test_it_is_checked_where_it_starts(folder, capsys):
    """The box above the clip is near it at t = 0, though not at rest; levels are written as they are then."""
    assert pdvol("check", folder / "bent.py", "--out", folder / "checked") == 0
    said = capsys.readouterr().out
    assert "body 'clip': starts away from rest, where bent leads it" in said
    assert "level 1: body 'clip' starts away from rest, its cells stretched by" in said
    assert (folder / "checked" / "level_1.vtu").exists()


def test_exports_keep_the_rest_shape_beside_the_states(folder, tmp_path):
    import meshio

    assert pdvol("export", folder / "whole", "--format", "xdmf", "-o", tmp_path) == 0
    level = open_run(folder / "whole").levels[1]
    with meshio.xdmf.TimeSeriesReader(next(tmp_path.rglob("*level_1*.xdmf"))) as series:
        points, _ = series.read_points_cells()
        _, data, _ = series.read_data(0)
    np.testing.assert_allclose(points[:, :2], level.rest)
    displacement = data["displacement"][:, :2]
    np.testing.assert_allclose(points[:, :2] + displacement, level.positions(0), atol=1e-12)
