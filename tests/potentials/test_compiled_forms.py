"""Compiled forms: the remains of a killed process do not stop the next one, and nobody waits for another process. What
compiling needs is named.
"""

import os
import signal
import subprocess
import sys
import time

import pytest

from commands import SAFETY
from pdvol import compiled
from pdvol.compiled import ASIDE
from pdvol.errors import InputError

COMPILE = """
import numpy as np
import ufl
from mpi4py import MPI
from pdvol.potentials.assembly.kernels import ONE_POINT, Kernel, tensors
given = ufl.Coefficient(tensors((2,)))
kernel = Kernel(MPI.COMM_SELF, given[0] / given[1] * ONE_POINT)
print(kernel.evaluate(np.array([[1.0, 3.0]]))[0, 0])
"""
STUCK = """#!/bin/sh
case "$*" in *aside-*) touch {reached}; exec sleep 1800;; *) exec cc "$@";; esac
"""
"""A C compiler that never ends on a form."""


@pytest.fixture
def started(tmp_path, monkeypatch):
    """Starts a process that compiles a form with an empty cache, or with what earlier ones have left."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return lambda **env: subprocess.Popen(
        [sys.executable, "-c", COMPILE],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, **env},
    )


def value(process) -> float:
    out, error = process.communicate(timeout=SAFETY)
    assert process.returncode == 0, error
    return float(out)


def kept(tmp_path) -> set[str]:
    (folder,) = (path for path in tmp_path.glob("pdvol/compiled/*"))
    return {path.name for path in folder.iterdir()}


def test_a_killed_first_compilation_does_not_stop_the_next_ones(started, tmp_path):
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
    both = started(), started()
    assert [*map(value, both)] == [pytest.approx(1 / 3)] * 2
    # What nobody works in any more is removed by the next process that compiles.
    (folder,) = tmp_path.rglob(left)
    os.utime(folder, (0.0, 0.0))
    for path in folder.parent.glob("*.so"):
        path.unlink()
    assert value(started()) == pytest.approx(1 / 3)
    found = kept(tmp_path)
    assert found and not any(name.startswith(ASIDE) for name in found)
    assert value(started()) == pytest.approx(1 / 3)
    assert kept(tmp_path) == found, "nothing is compiled again"


# ---- what compiling needs


def test_declared_code_is_compiled_before_its_first_use(tmp_path, monkeypatch):
    """A library of two files, in a thread; and that of another dimension when it is used."""
    monkeypatch.setattr(compiled, "cache_folder", lambda: tmp_path / "cache")
    folder = tmp_path / "code" / "native"
    folder.mkdir(parents=True)
    (folder / "interface.h").write_text("double one_of_two(void);\ndouble two_of_two(void);\n")
    for name, value in (("one", "DIM"), ("two", 2)):
        (folder / f"{name}.c").write_text(f'#include "interface.h"\ndouble {name}_of_two(void) {{ return {value}; }}\n')
    library, end = compiled.Library(folder), time.monotonic() + SAFETY
    library.build_beside()
    while not list(tmp_path.glob("cache/code-*")):
        assert time.monotonic() < end
        time.sleep(0.01)
    assert [(library[d].one_of_two(), library[d].two_of_two()) for d in (2, 3)] == [(2.0, 2.0), (3.0, 2.0)]


def test_which_compiler_is_taken(tmp_path, monkeypatch):
    """That of CC, then cc, then the package ziglang, then none, which is named on one line."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(InputError, match="no C compiler: CC=no-such-compiler is not found; install gcc[^\n]*$"):
        compiled.compiler()
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compiled.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="no C compiler: there is neither cc, gcc nor clang; install gcc, or run: pip"):
        compiled.compiler()
    monkeypatch.setattr(compiled.importlib.util, "find_spec", lambda name: name == "ziglang" or None)
    assert compiled.compiler() == [sys.executable, "-m", "ziglang", "cc"]
    for name in ("cc", "own"):
        (tmp_path / name).write_text("#!/bin/sh\n")
        (tmp_path / name).chmod(0o755)
    assert compiled.compiler() == ["cc"]
    monkeypatch.setenv("CC", "own -pipe")
    assert compiled.compiler() == ["own", "-pipe"]
