"""Runs a mesher in a process of its own.

A mesher that crashes, hangs or prints, and the libraries that it loads, then do not affect the solver's process.
"""

import resource
import signal
import subprocess
import sys
import tempfile
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.compiled import compiler
from pdvol.errors import InputError, MeshError
from pdvol.meshing.cpu_budget import BudgetSpent, ProcessStopped, Watch
from pdvol.processes import die_with_parent, limit_processor_time, without_launcher

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

    Raises
    ------
    InputError
        There is no C compiler, or it fails: without the library no mesh of fTetWild could be made a second time.
    """
    words = compiler()
    with tempfile.TemporaryDirectory(prefix="pdvol-compile-") as folder:
        source, library = Path(folder) / "fixed_random.c", Path(folder) / "fixed_random.so"
        source.write_text(_SEEDED_RANDOM_DEVICE)
        command = [*words, "-shared", "-fPIC", "-O1", "-o", str(library), str(source)]
        try:
            subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise InputError(f"the C compiler {words[0]} failed: {error}") from None
        return library.read_bytes()


def _limited(seconds: float) -> None:
    """In the child: end with pdvol, and by SIGXCPU after so many seconds of processor time."""
    die_with_parent()
    limit_processor_time(seconds, grace=5)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def run_worker(script: str, cpu_seconds: float, seeded: bool = False, **arrays: np.ndarray) -> dict[str, np.ndarray]:
    """Run `script` (a file beside this one) with `arrays` as its input and return its output.

    Parameters
    ----------
    script : file name, for example "gmsh_worker.py"; called with the paths of an input and an output npz file
    cpu_seconds : processor time [s] that the process may use. How busy the machine is does not matter to it.
    seeded : whether `std::random_device` gives the same numbers in every process
    arrays : what the script reads

    Returns
    -------
    dict of arrays

    Raises
    ------
    MeshError
        The process crashed, or reported an error: the message quotes the last line it wrote.
    ProcessStopped
        It waited without end, or used up its processor time, or that of the command (`BudgetSpent`).
    """
    env = without_launcher()
    path = Path(__file__).with_name(script)
    with tempfile.TemporaryDirectory(prefix="pdvol-mesh-") as folder:
        if seeded and sys.platform.startswith("linux"):
            library = Path(folder) / "fixed_random.so"
            library.write_bytes(_seeded_random_device())
            env["LD_PRELOAD"] = ":".join(filter(None, [str(library), env.get("LD_PRELOAD")]))
        given, made = Path(folder) / "in.npz", Path(folder) / "out.npz"
        contents: dict[str, Any] = arrays
        np.savez(given, **contents)
        # -P: the script's own folder must not shadow other packages.
        with subprocess.Popen(
            [sys.executable, "-P", str(path), str(given), str(made)],
            env=env,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            preexec_fn=partial(_limited, cpu_seconds),
        ) as done:
            out, err = _watched(done, path.stem)
        if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            spent = (
                f"used up its {cpu_seconds:.0f} s of processor time"
                if done.returncode == -signal.SIGXCPU
                else ("was killed, probably for lack of memory")
            )
            raise ProcessStopped(f"{path.stem} {spent}")
        if done.returncode < 0:
            raise MeshError(f"{path.stem} crashed ({signal.Signals(-done.returncode).name})")
        if done.returncode or not made.exists():
            lines = (err or out).strip().splitlines() or [f"exit status {done.returncode}"]
            raise MeshError(f"{path.stem} failed: {lines[-1].strip()[:300]}")
        with np.load(made) as data:
            return dict(data)


def _watched(process: subprocess.Popen, name: str) -> tuple[str, str]:
    """What the process has written to its standard output and error, at its end."""
    watch = Watch(process.pid)
    try:
        while True:
            try:
                return process.communicate(timeout=1.0)
            except subprocess.TimeoutExpired:
                reason = watch.reason_to_end()
                if reason:
                    raise (BudgetSpent if watch.spent else ProcessStopped)(f"{name} {reason}") from None
    except BaseException:
        process.kill()
        raise
