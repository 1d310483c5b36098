"""Compiled forms: the remains of a killed process do not stop the next one, and nobody waits for another process."""

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

from commands import SAFETY
from pdvol.potentials.assembly.compiled_forms import ASIDE

COMPILE = """
from mpi4py import MPI
from problems import elastic, SOFT
from shapes import box
from pdvol.levels.space import LevelSpace
from pdvol.potentials.potential import Positions
space = LevelSpace(box(2, 1), MPI.COMM_SELF)
(term,) = elastic(space, SOFT)
print(term.value(Positions(space, 1.1 * space.from_input(space.mesh.points))))
"""
STUCK = """#!/bin/sh
case "$*" in *libffcx*) touch {reached}; exec sleep 1800;; *) exec cc "$@";; esac
"""
"""A C compiler that never ends on a form."""


@pytest.fixture
def started(tmp_path, monkeypatch):
    """Starts a process that compiles an elastic term with an empty cache, or with what earlier ones have left."""
    import shapes

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(shapes.__file__.rpartition("/")[0]))
    return lambda **env: subprocess.Popen(
        [sys.executable, "-c", COMPILE],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, **env},
    )


def energy(process) -> float:
    out, error = process.communicate(timeout=SAFETY)
    assert process.returncode == 0, error
    return float(out)


def kept(tmp_path) -> set[str]:
    (folder,) = tmp_path.rglob("forms")
    return {path.name for path in folder.iterdir()}


def test_a_killed_first_compilation_does_not_stop_the_next(started, tmp_path):
    compiler, reached = tmp_path / "cc", tmp_path / "reached"
    compiler.write_text(STUCK.format(reached=reached))
    compiler.chmod(0o755)
    first = started(CC=str(compiler))
    begin = time.monotonic()
    while not reached.exists():
        assert first.poll() is None and time.monotonic() - begin < SAFETY, first.communicate()[1]
        time.sleep(0.02)
    os.killpg(first.pid, signal.SIGKILL)
    first.communicate()
    (left,) = kept(tmp_path)
    assert left.startswith(ASIDE), "nothing half-made where the next process looks"
    assert energy(started()) > 0.0
    # What nobody works in any more is removed by the next process that compiles.
    (folder,) = tmp_path.rglob(left)
    os.utime(folder, (0.0, 0.0))
    for path in folder.parent.iterdir():
        if path != folder:
            shutil.rmtree(path)
    assert energy(started()) > 0.0
    assert not any(name.startswith(ASIDE) for name in kept(tmp_path))


def test_two_cold_starts(started, tmp_path):
    both = started(), started()
    expected, same = map(energy, both)
    assert same == expected > 0.0
    found = kept(tmp_path)
    assert found and not any(name.startswith(ASIDE) for name in found)
    assert energy(started()) == expected
    assert kept(tmp_path) == found, "nothing is compiled again"
