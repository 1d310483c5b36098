"""Copies of runs, also of those that are being written."""

import json

import numpy as np
import pytest

from pdvol.errors import InputError
from pdvol.store.copying import copy_run, require_new
from pdvol.store.reader import open_run
from pdvol.store.writer import RunWriter


def test_a_copy_is_a_run_up_to_a_step_and_a_second_one_brings_the_rest(small_run, tmp_path):
    run = open_run(small_run)
    copy_run(run.path, tmp_path / "copy", 3, 1)
    copy = open_run(tmp_path / "copy")
    assert len(copy.levels) == 1 and copy.levels[0].steps == 3 and copy.info["state"] == "interrupted"
    for step in range(3):
        np.testing.assert_array_equal(copy.levels[0].positions(step), run.levels[0].positions(step))
    assert all(r["step"] < 3 and r["level"] == 0 for r in copy.levels[0].log)
    assert [o.name for o in copy.obstacles] == [o.name for o in run.obstacles]
    copy_run(run.path, tmp_path / "copy")
    copy = open_run(tmp_path / "copy")
    assert [level.steps for level in copy.levels] == [run.levels[0].steps] * 2
    assert copy.info["levels"] == run.info["levels"]


def test_a_run_that_is_being_written_gives_an_interrupted_copy_that_goes_on(small_run, tmp_path):
    with RunWriter.open(small_run) as writer:
        writer.set_level_state(0, "running")
        copy_run(small_run, tmp_path / "copy")
    assert json.loads((tmp_path / "copy" / "run.json").read_text())["levels"][0]["state"] == "interrupted"
    with RunWriter.open(tmp_path / "copy") as writer:
        assert writer.steps(0) == open_run(small_run).levels[0].steps


def test_a_folder_that_holds_something_is_not_written_to(small_run, tmp_path):
    require_new(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    require_new(tmp_path / "empty")
    with pytest.raises(InputError, match="is there already"):
        require_new(small_run)


def test_a_link_out_of_the_folder_is_not_copied(small_run, tmp_path):
    (tmp_path / "secret.npz").write_bytes(b"secret")
    (small_run / "render").mkdir(exist_ok=True)
    (small_run / "render" / "0.npz").symlink_to(tmp_path / "secret.npz")
    with pytest.raises(InputError, match=r"0\.npz is a link that leads out of the folder"):
        copy_run(small_run, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()
