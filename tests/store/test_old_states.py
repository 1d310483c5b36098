"""Runs of format 1, which have a file for each state, are read as they are and converted when they are written."""

import json
import shutil
import signal

import numpy as np
import pytest
from test_kill import ended

from pdvol.errors import InputError
from pdvol.store.copying import copy_run
from pdvol.store.reader import open_run
from pdvol.store.states import HEAD
from pdvol.store.writer import RunWriter


@pytest.fixture
def old_run(flat_run, tmp_path):
    """The run `flat_run` as it was stored before."""
    path = shutil.copytree(flat_run, tmp_path / "old")
    for level in open_run(flat_run).levels:
        folder, sums = path / "levels" / str(level.index), b""
        for step in range(level.steps):
            np.save(folder / f"{step:06d}.npy", level.positions(step))
            sums += HEAD.unpack(level.states._bytes(step, HEAD.size))[1].to_bytes(4, "little")
        (folder / "checksums.bin").write_bytes(sums)
        (folder / "states.bin").unlink()
    info = json.loads((path / "run.json").read_text())
    (path / "run.json").write_text(json.dumps({**info, "format": 1}))
    return path


def assert_same(path, other, steps=7):
    for level, its in zip(open_run(path).levels, open_run(other).levels, strict=True):
        assert level.steps == steps
        for step in range(steps):
            np.testing.assert_array_equal(level.positions(step), its.positions(step))


def test_it_is_read_copied_and_converted_when_it_is_written(old_run, flat_run, tmp_path):
    before = {file: file.stat().st_mtime_ns for file in old_run.rglob("*")}
    assert_same(old_run, flat_run)
    copy_run(old_run, tmp_path / "copy")
    assert_same(tmp_path / "copy", flat_run)
    assert open_run(tmp_path / "copy").info["format"] == 2 and not list(tmp_path.glob("copy/levels/*/0*.npy"))
    assert {file: file.stat().st_mtime_ns for file in old_run.rglob("*")} == before
    with RunWriter.open(old_run) as writer:
        assert writer.steps(0) == writer.steps(1) == 7
    assert_same(old_run, flat_run)
    names = lambda run: {file.name for file in (run / "levels" / "0").iterdir()}
    assert names(old_run) == names(flat_run) and open_run(old_run).info == open_run(flat_run).info


def test_a_conversion_that_is_killed_loses_nothing(old_run, flat_run, tmp_path):
    convert = lambda path: lambda: RunWriter.open(path).close()
    code, operations = ended(convert(shutil.copytree(old_run, tmp_path / "whole")), tmp_path / "whole", 0)
    assert code == 0 < operations
    for number, deadly in enumerate(np.linspace(1, operations, 7).astype(int)):
        path = shutil.copytree(old_run, tmp_path / str(number))
        assert ended(convert(path), path, deadly) == (-signal.SIGKILL, 0)
        assert_same(path, flat_run)
        RunWriter.open(path).close()
        assert_same(path, flat_run)
        assert not list(path.glob("levels/*/0*.npy"))


def test_damage_is_named(old_run):
    file = old_run / "levels" / "1" / "000003.npy"
    data = bytearray(file.read_bytes())
    data[-3] ^= 1
    file.write_bytes(data)
    with pytest.raises(InputError, match=r"000003.npy is damaged.*usable states of level 1: 0 to 2, 4 to 6"):
        open_run(old_run).levels[1].positions(3)
    with pytest.raises(InputError, match=r"000003.npy is damaged"):
        RunWriter.open(old_run)
    (old_run / "levels" / "1" / "checksums.bin").unlink()  # as of the oldest runs
    assert np.isfinite(open_run(old_run).levels[1].positions(3)).all()
    for damage in (data[:-1], data[:40], b"", bytes(data).replace(b"<f8", b"<f4")):
        file.write_bytes(damage)
        assert [level.steps for level in open_run(old_run).levels] == [7, 3]
        with pytest.raises(InputError, match="usable states of level 1: 0 to 2"):
            open_run(old_run).levels[1].positions(3)
    with RunWriter.open(old_run) as writer:
        assert [writer.steps(level) for level in (0, 1)] == [7, 3]
