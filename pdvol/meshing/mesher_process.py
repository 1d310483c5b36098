"""Runs a mesher in a process of its own.

A mesher that crashes, hangs or prints, and the libraries that it loads, then do not affect the solver's process.
"""

import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import MeshError
from pdvol.processes import die_with_parent, without_launcher

# C source of a std::random_device that returns the same linear congruential sequence in every process. fTetWild
# shuffles with a std::mt19937 that std::random_device seeds, so without it the same input would give a different mesh
# each time. The library is preloaded in the mesher's process. The Itanium C++ ABI fixes the symbol's name in libstdc++.
_SEEDED_RANDOM_DEVICE = """
unsigned int _ZNSt13random_device9_M_getvalEv(void *self)
{
    static unsigned int state = 1u;
    (void)self;
    return state = state * 1664525u + 1013904223u;
}
"""


@cache
def _seeded_random_device() -> bytes:
    """The shared library compiled from `_SEEDED_RANDOM_DEVICE`.

    Empty without a C compiler or outside Linux; fTetWild's meshes then differ from build to build.
    """
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None or not sys.platform.startswith("linux"):
        return b""
    try:
        with tempfile.TemporaryDirectory(prefix="pdvol-compile-") as folder:
            source, library = Path(folder) / "fixed_random.c", Path(folder) / "fixed_random.so"
            source.write_text(_SEEDED_RANDOM_DEVICE)
            command = [compiler, "-shared", "-fPIC", "-O1", "-o", str(library), str(source)]
            done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=60)
            return b"" if done.returncode else library.read_bytes()
    except (OSError, subprocess.SubprocessError):
        return b""


def run_worker(script: str, timeout: float, **arrays: np.ndarray) -> dict[str, np.ndarray]:
    """Run `script` (a file beside this one) with `arrays` as its input and return its output.

    Parameters
    ----------
    script : file name, for example "gmsh_worker.py"; called with the paths of an input and an output npz file
    timeout : time limit [s], after which the process is killed
    arrays : what the script reads

    Returns
    -------
    dict of arrays

    Raises
    ------
    MeshError
        The process crashed, exceeded the time limit or reported an error; the message quotes the last line it wrote.
    """
    env = without_launcher()
    path = Path(__file__).with_name(script)
    with tempfile.TemporaryDirectory(prefix="pdvol-mesh-") as folder:
        if _seeded_random_device():
            library = Path(folder) / "fixed_random.so"
            library.write_bytes(_seeded_random_device())
            env["LD_PRELOAD"] = ":".join(filter(None, [str(library), env.get("LD_PRELOAD")]))
        given, made = Path(folder) / "in.npz", Path(folder) / "out.npz"
        contents: dict[str, Any] = arrays
        np.savez(given, **contents)
        try:
            # -P: the script's own folder must not shadow other packages.
            done = subprocess.run(
                [sys.executable, "-P", str(path), str(given), str(made)],
                env=env,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=timeout,
                text=True,
                errors="replace",
                preexec_fn=die_with_parent,
            )
        except subprocess.TimeoutExpired as error:
            raise MeshError(f"{path.stem} did not finish within {timeout:g} s") from error
        if done.returncode or not made.exists():
            lines = (done.stderr or done.stdout).strip().splitlines() or [f"exit status {done.returncode}"]
            raise MeshError(f"{path.stem} failed: {lines[-1].strip()[:300]}")
        with np.load(made) as data:
            return dict(data)
