"""Compiled forms: the remains of a killed process do not stop the next one, and processes wait for each other."""

import subprocess
import sys

import pytest

from commands import SAFETY
from pdvol.potentials.assembly.compiled_forms import COMPILING, FINISHED

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


@pytest.fixture
def started(tmp_path, monkeypatch):
    """Starts a process that compiles an elastic term with an empty cache, or with what earlier ones have left."""
    import shapes

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(shapes.__file__.rpartition("/")[0]))
    return lambda: subprocess.Popen(
        [sys.executable, "-c", COMPILE], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def energy(process) -> float:
    out, error = process.communicate(timeout=SAFETY)
    assert process.returncode == 0, error
    return float(out)


def test_two_processes_and_what_a_killed_one_has_left(started, tmp_path):
    both = started(), started()
    expected, same = map(energy, both)
    assert same == expected > 0.0
    (lock,) = tmp_path.rglob("forms/lock")
    assert lock.read_bytes() == FINISHED
    # As a process leaves it that is killed between the opening of a form's source and the end of the compiler.
    lock.write_bytes(COMPILING)
    ready = list(tmp_path.rglob("forms/*.c.cached"))
    assert ready
    for file in ready:
        file.unlink()
        file.with_suffix("").write_text("")
    assert energy(started()) == expected
