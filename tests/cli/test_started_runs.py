"""Runs of bodies that start away from rest: stored, checked, exported."""

import numpy as np

from cli_scenes import pdvol
from pdvol import open_run
from variants import STEPS


def test_states_begin_bent_and_are_sound(made):
    stored = open_run(made("bent"))
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


def test_another_start_is_not_resumed_and_no_branch_either(made, tmp_path, capsys):
    assert made.run("bent", made("bent"), "--resume", "--set", "turn=0.9") == 2
    assert "bodies[0].start" in capsys.readouterr().err
    assert made.run("bent", tmp_path / "b", "--branch", made("bent"), "--at", 3, "--set", "turn=0.9") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "cannot go on from step 3 with another start" in line and not (tmp_path / "b").exists()


def test_a_start_inside_out_ends_in_one_line_and_nothing_is_written(made, tmp_path, capsys):
    assert made.run("bent", tmp_path / "mirrored", "--set", "mirror=-1") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "level 0: the start of body 'clip' turns 18 of 18 cells inside out or flat" in line
    assert not (tmp_path / "mirrored").exists()
    assert pdvol("check", made("bent").with_name("bent.py"), "--set", "mirror=-1") == 2
    said = capsys.readouterr()
    assert "defect at level 1: the start of body 'clip' turns 72 of 72 cells" in said.out + said.err


def test_it_is_checked_where_it_starts(made, tmp_path, capsys):
    """The box above the clip is near it at t = 0, though not at rest; levels are written as they are then."""
    assert pdvol("check", made("bent").with_name("bent.py"), "--out", tmp_path / "checked") == 0
    said = capsys.readouterr().out
    assert "body 'clip': starts away from rest, where bent leads it" in said
    assert "level 1: body 'clip' starts away from rest, its cells stretched by" in said
    assert (tmp_path / "checked" / "level_1.vtu").exists()
