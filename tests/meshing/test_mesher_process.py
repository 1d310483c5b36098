"""Meshers in processes of their own: limits of processor time, crashes, and the same result under load."""

import os
import signal
import time

import numpy as np
import pytest

from pdvol import meshes
from pdvol.errors import MeshError
from pdvol.meshing import tetrahedralise
from pdvol.meshing.child_process import Child
from pdvol.meshing.cpu_budget import ProcessStopped
from pdvol.meshing.edge_length import MAX_ATTEMPTS, SizedMesh, mesh_of_target_size


def spin() -> None:
    while True:
        pass


def pause(seconds: float) -> np.ndarray:
    time.sleep(seconds)
    return np.arange(3)


def crash() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def test_running_out_of_processor_time_is_an_error():
    with Child() as child, pytest.raises(ProcessStopped, match="mesher used up its 1 s of processor time"):
        child.call("mesher", spin, cpu_seconds=1.0)


def test_waiting_does_not_count():
    with Child() as child:
        assert child.call("mesher", pause, 2.5, cpu_seconds=2.0).tolist() == [0, 1, 2]


def test_a_crash_is_named():
    with Child() as child, pytest.raises(MeshError, match="mesher crashed \\(SIGSEGV\\)") as caught:
        child.call("mesher", crash, cpu_seconds=5.0)
    assert not isinstance(caught.value, ProcessStopped), "it may be called again with another edge length"


@pytest.mark.parametrize(
    ("error", "calls", "said"),
    [
        (ProcessStopped("fTetWild used up its 31 s"), 1, "no mesh of about 50 vertices: fTetWild used up"),
        (MeshError("fTetWild crashed (SIGSEGV)"), MAX_ATTEMPTS, "no valid mesh of about 50 .*fTetWild crashed"),
    ],
)
def test_a_mesher_that_ends_early_is_called_again_only_after_a_crash(monkeypatch, error, calls, said):
    """With another edge length, which it may well take; its time is not spent twice."""
    lengths = []

    def end(vertices, triangles, edge_length, *_limits):
        lengths.append(edge_length)
        raise error

    monkeypatch.setattr(tetrahedralise, "ftetwild", end)
    with pytest.raises(MeshError, match=said) as caught:
        tetrahedralise.tetrahedralise(meshes.box(), 50)
    assert len(lengths) == len(set(lengths)) == calls and "\n" not in str(caught.value)


@pytest.mark.parametrize(("fine", "coarse"), [(3000, 100), (1800, 100), (3000, 600), (1800, 1800), (3000, 3000)])
def test_a_search_ends_never_repeats_a_scale_and_takes_the_closest(fine, coarse):
    scales = []

    def make(scale, failures):
        scales.append(scale)
        points = np.zeros((fine if scale < 0.5 else coarse, 3))
        return SizedMesh(points, np.zeros((0, 4), dtype=np.int64), points)

    closest = 1800 if fine == 1800 else 600
    if fine == 3000 and coarse != 600:
        with pytest.raises(MeshError, match="1000 vertices cannot be had, the closest mesh has"):
            mesh_of_target_size(make, 1000, "steps", 1.0, 3)
    else:
        assert len(mesh_of_target_size(make, 1000, "steps", 1.0, 3).points) == closest
    assert len(scales) == len(set(scales)) == {1800: 3, 3000: 2}.get(coarse, MAX_ATTEMPTS)
