"""Meshers in processes of their own: limits of processor time, crashes, and the same result under load."""

import numpy as np
import pytest

from pdvol import meshes
from pdvol.errors import MeshError
from pdvol.meshing import mesher_process, tetrahedralise
from pdvol.meshing.cpu_budget import ProcessStopped
from pdvol.meshing.edge_length import MAX_ATTEMPTS, mesh_of_target_size
from pdvol.meshing.mesher_process import run_worker


def script(folder, text, monkeypatch):
    """A worker beside a copy of nothing: `run_worker` looks for it in `folder`."""
    (folder / "worker.py").write_text(text)
    monkeypatch.setattr(mesher_process, "__file__", str(folder / "mesher_process.py"))
    return "worker.py"


def test_running_out_of_processor_time_is_an_error(tmp_path, monkeypatch):
    endless = script(tmp_path, "while True: pass", monkeypatch)
    with pytest.raises(ProcessStopped, match="used up its 1 s of processor time"):
        run_worker(endless, 1.0)


def test_waiting_does_not_count(tmp_path, monkeypatch):
    text = "import sys, time\ntime.sleep(2.5)\nimport numpy as np\nnp.savez(sys.argv[2], made=np.arange(3))"
    assert run_worker(script(tmp_path, text, monkeypatch), 2.0)["made"].tolist() == [0, 1, 2]


def test_a_crash_is_named(tmp_path, monkeypatch):
    with pytest.raises(MeshError, match="crashed \\(SIGSEGV\\)") as caught:
        run_worker(script(tmp_path, "import os\nos.kill(os.getpid(), 11)", monkeypatch), 5.0)
    assert not isinstance(caught.value, ProcessStopped), "it may be called again with another edge length"


@pytest.mark.parametrize(
    ("error", "calls", "said"),
    [
        (ProcessStopped("tet_worker used up its 31 s"), 1, "no mesh of about 50 vertices: tet_worker used up"),
        (MeshError("tet_worker crashed (SIGSEGV)"), MAX_ATTEMPTS, "no valid mesh of about 50 .*tet_worker crashed"),
    ],
)
def test_a_mesher_that_ends_early_is_called_again_only_after_a_crash(monkeypatch, error, calls, said):
    """With another edge length, which it may well take; its time is not spent twice."""
    lengths = []

    def end(*_args, edge_length, **_arrays):
        lengths.append(float(edge_length))
        raise error

    monkeypatch.setattr(tetrahedralise, "run_worker", end)
    with pytest.raises(MeshError, match=said) as caught:
        tetrahedralise.tetrahedralise(meshes.box(), 50)
    assert len(lengths) == len(set(lengths)) == calls and "\n" not in str(caught.value)


@pytest.mark.parametrize(("fine", "coarse"), [(3000, 100), (1800, 100), (3000, 600)])
def test_a_search_ends_never_repeats_a_scale_and_takes_the_closest(fine, coarse):
    scales = []

    def make(scale, failures):
        scales.append(scale)
        return np.zeros((fine if scale < 0.5 else coarse, 3)), np.zeros((0, 4), dtype=np.int64)

    if (fine, coarse) == (3000, 100):
        with pytest.raises(MeshError, match="1000 vertices cannot be had, the closest mesh has"):
            mesh_of_target_size(make, 1000, "steps", 1.0, 3)
    else:
        closest = 1800 if fine == 1800 else 600
        assert len(mesh_of_target_size(make, 1000, "steps", 1.0, 3).points) == closest
    assert len(scales) == MAX_ATTEMPTS == len(set(scales))
