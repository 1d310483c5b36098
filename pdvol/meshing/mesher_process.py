"""Runs a mesher in a process of its own: its crash, hang or chatter, and the libraries it loads, then stay out of the
solver's process.
"""

import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from pdvol.errors import MeshError
from pdvol.processes import die_with_parent, without_launcher

# fTetWild shuffles with a std::mt19937 seeded from std::random_device, so the same input would give another mesh every
# time. The child gets this definition instead (a linear congruential sequence), preloaded; libstdc++'s symbol name is
# fixed by the Itanium C++ ABI.
_FIXED_RANDOM = """
unsigned int _ZNSt13random_device9_M_getvalEv(void *self)
{
    static unsigned int state = 1u;
    (void)self;
    return state = state * 1664525u + 1013904223u;
}
"""


@cache
def _fixed_random() -> bytes:
    """The compiled replacement; empty without a C compiler or ELF preloading, and meshes then vary from build to build."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None or not sys.platform.startswith("linux"):
        return b""
    try:
        with tempfile.TemporaryDirectory(prefix="pdvol-compile-") as folder:
            source, library = Path(folder) / "fixed_random.c", Path(folder) / "fixed_random.so"
            source.write_text(_FIXED_RANDOM)
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
    timeout : seconds after which the child is stopped
    arrays : what the script reads

    Returns
    -------
    dict of arrays

    Raises
    ------
    MeshError
        The child crashed, ran out of time or reported an error; the last line it wrote is quoted.
    """
    env = without_launcher()
    path = Path(__file__).with_name(script)
    with tempfile.TemporaryDirectory(prefix="pdvol-mesh-") as folder:
        if _fixed_random():
            library = Path(folder) / "fixed_random.so"
            library.write_bytes(_fixed_random())
            env["LD_PRELOAD"] = ":".join(filter(None, [str(library), env.get("LD_PRELOAD")]))
        given, made = Path(folder) / "in.npz", Path(folder) / "out.npz"
        np.savez(given, **arrays)
        try:
            # -P: the script's own folder must not shadow other packages.
            done = subprocess.run(
                [sys.executable, "-P", str(path), str(given), str(made)],
                env=env, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, timeout=timeout, text=True, errors="replace",
                preexec_fn=die_with_parent,
            )  # fmt: skip
        except subprocess.TimeoutExpired as error:
            raise MeshError(f"{path.stem} did not finish within {timeout:g} s") from error
        if done.returncode or not made.exists():
            lines = (done.stderr or done.stdout).strip().splitlines() or [f"exit status {done.returncode}"]
            raise MeshError(f"{path.stem} failed: {lines[-1].strip()[:300]}")
        with np.load(made) as data:
            return dict(data)
