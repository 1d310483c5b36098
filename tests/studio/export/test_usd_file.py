"""USD files on their way to the disk: how much memory they take, and what is left of one that fails."""

import errno
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import runs
from commands import SAFETY
from exported import write_usd
from pdvol.errors import InputError, SimulationError
from pdvol.store.reader import open_run
from pdvol.studio.export import usd_file
from pdvol.studio.export.exports import export_run

pytest.importorskip("pxr", reason="usd-core is an optional extra")
from pxr import Sdf, Usd, UsdGeom

STATES = (20, 140)
VERTICES = 5000  # all of a 2D body are drawn: 140 states are 17 MB of points and velocities
GROWTH = 6e6  # bytes by which the longer export's memory may be larger; without saves it is 15 MB

MEASURED = """
import sys
from pathlib import Path
from pdvol.studio.export import usd_file
from pdvol.studio.export.exports import export_run
usd_file.UNSAVED_BYTES = 2_000_000
export_run(Path(sys.argv[1]), "usd", Path(sys.argv[2]))
print(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))  # kB, of this program
"""
KILLED = """
import os, signal, sys
from pathlib import Path
from pdvol.studio.export import usd_file
from pdvol.studio.export.exports import export_run
usd_file.UNSAVED_BYTES = 10_000
save, saves = usd_file.UsdFile.save, []

def killed(file):
    saves.append(save(file))
    if len(saves) == 3:
        os.kill(os.getpid(), signal.SIGKILL)

usd_file.UsdFile.save = killed
export_run(Path(sys.argv[1]), "usd", Path(sys.argv[2]))
"""


def in_process(program: str, *arguments) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)], capture_output=True, text=True, timeout=SAFETY
    )


def long_run(path: Path, states: int) -> Path:
    """One level of made-up states, written as the store writes them but without waiting for the disk."""
    runs.stored_run(path, 2, (VERTICES,), 0)
    level = open_run(path).levels[0]
    for step in range(states):
        runs.put_state(level.folder, step, runs.moved(level.mesh, 1e-3 * step))
    assert open_run(path).levels[0].steps == states
    return path


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the peak of memory is read from Linux's /proc")
def test_memory_does_not_grow_with_the_number_of_frames(tmp_path):
    peaks = []
    for states in STATES:
        ended = in_process(MEASURED, long_run(tmp_path / f"run{states}", states), tmp_path / "out")
        assert ended.returncode == 0, ended.stderr
        peaks.append(1024 * int(ended.stdout))
    assert (tmp_path / "out" / f"run{STATES[1]}.usdc").stat().st_size > 15e6
    assert abs(peaks[1] - peaks[0]) < GROWTH


def test_a_file_saved_in_pieces_holds_what_one_saved_at_once_holds(solid_run, tmp_path, monkeypatch):
    run = open_run(solid_run)
    saves = []
    save = usd_file.UsdFile.save
    with monkeypatch.context() as patch:
        patch.setattr(usd_file, "UNSAVED_BYTES", 1)
        patch.setattr(usd_file.UsdFile, "save", lambda file: saves.append(save(file)))
        pieces = write_usd(run, [0, 1], tmp_path / "pieces")
    assert len(saves) > 2 * 5 * 3, "after each mesh of each frame"
    at_once = write_usd(run, [0, 1], tmp_path / "at_once")
    texts = [Sdf.Layer.FindOrOpen(str(path)).ExportToString() for path in (pieces, at_once)]
    assert texts[0] == texts[1] and len(texts[0]) > 100_000


def test_a_killed_export_leaves_the_earlier_file_as_it_was(solid_run, tmp_path):
    (file,), _ = export_run(solid_run, "usd", tmp_path, levels=[0])
    earlier = file.read_bytes()
    assert in_process(KILLED, solid_run, tmp_path).returncode == -signal.SIGKILL
    assert file.read_bytes() == earlier
    (aside,) = set(tmp_path.iterdir()) - {file}
    assert aside.name.startswith(".")
    assert export_run(solid_run, "usd", tmp_path)[0] == [file] and list(tmp_path.iterdir()) == [file]
    assert file.read_bytes() != earlier


def test_an_interrupted_export_and_a_folder_that_is_a_file_leave_nothing(solid_run, tmp_path, monkeypatch):
    def interrupted(file):
        raise KeyboardInterrupt

    (tmp_path / "file").write_text("a file")
    with pytest.raises(InputError, match=r"file is a file, not a folder"):
        export_run(solid_run, "usd", tmp_path / "file")
    monkeypatch.setattr(usd_file, "UNSAVED_BYTES", 10_000)
    monkeypatch.setattr(usd_file.UsdFile, "save", interrupted)
    with pytest.raises(KeyboardInterrupt):
        export_run(solid_run, "usd", tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("piece", [10_000, 10**9])
def test_a_file_that_cannot_grow_is_said_in_one_line(solid_run, tmp_path, monkeypatch, piece):
    """As a full disk and a quota are said; in the middle of the export, or at its end."""
    monkeypatch.setattr(usd_file, "UNSAVED_BYTES", piece)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, limits[1]))
    try:
        with pytest.raises(SimulationError) as error:
            export_run(solid_run, "usd", tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert str(error.value) == f"cannot write {tmp_path / 'solid.usdc'}: {os.strerror(errno.EFBIG)}"
    assert list(tmp_path.iterdir()) == []
    (file,), _ = export_run(solid_run, "usd", tmp_path)  # while the error is kept
    stage = Usd.Stage.Open(str(file))
    assert len(UsdGeom.Mesh(stage.GetPrimAtPath("/run/bodies/left")).GetPointsAttr().GetTimeSamples()) == 5
