"""C code that is built once per machine, with the C compiler that FFCx needs anyway, and loaded through cffi."""

import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from threading import Lock, Thread
from typing import Any

import _cffi_backend
import cffi
import numpy as np

from pdvol.errors import InputError, PdvolError
from pdvol.processes import cores
from pdvol.stages import stage

# options of the C compiler: vector instructions of this processor, no fused multiply-add, so that sums repeat on one
# kind of processor, and no errno or traps, which would prevent vectorisation
FLAGS = ("-O3", "-march=native", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")
ASIDE = "aside-"
"""How the names of the folders in which processes compile begin."""
ABANDONED_SECONDS = 86_400.0
"""Age [s] of such a folder from which on it is that of a killed process. Compiling takes seconds."""

ffi = cffi.FFI()


@cache
def cache_folder() -> Path:
    """Where compiled code is kept: one folder per kind of processor, since it is compiled for the one at hand."""
    try:
        cpu = next(line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("flags"))
    except (OSError, StopIteration):
        cpu = platform.processor()
    key = hashlib.sha256(f"{platform.machine()} {cpu}".encode()).hexdigest()[:12]
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pdvol" / "compiled" / key


def compiler() -> list[str]:
    """The words that call the C compiler: those of CC, else cc, gcc, clang or that of the package ziglang.

    Raises
    ------
    InputError
        There is none.
    """
    chosen = shlex.split(os.environ.get("CC", ""))
    for words in [chosen] if chosen else [["cc"], ["gcc"], ["clang"]]:
        if shutil.which(words[0]):
            return words
    if not chosen and importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    missing = f"CC={chosen[0]} is not found" if chosen else "there is neither cc, gcc nor clang"
    raise InputError(f"no C compiler: {missing}; install gcc, or run: pip install ziglang")


class Library:
    """The functions of a folder's C files: `library[d]` has those for dimension d, built and loaded when the first of
    them is needed.

    Parameters
    ----------
    folder : whose interface.h, which its C files include, is declared to `ffi` at once, without preprocessor lines
    definitions : macros of the compiler's command line, besides the dimension DIM
    """

    def __init__(self, folder: Path, definitions: Mapping[str, int] | None = None):
        lines = (folder / "interface.h").read_text().splitlines(keepends=True)
        ffi.cdef("".join(line for line in lines if not line.startswith("#")))
        self._load = lambda d: _load(folder, {**(definitions or {}), "DIM": d})
        self._loaded: dict[int, Any] = {}
        self._lock = Lock()

    def __getitem__(self, d: int) -> Any:
        if d not in self._loaded:
            with self._lock:
                self._loaded[d] = self._loaded.get(d) or self._load(d)
        return self._loaded[d]

    def build_beside(self, d: int = 3) -> None:
        """Builds those for dimension d in a thread, unless they exist. Where that fails, their first use does."""

        def build() -> None:
            with suppress(PdvolError, OSError):
                self[d]

        Thread(target=build, name="pdvol-compiler", daemon=True).start()  # an interrupt does not wait for it


def _load(folder: Path, definitions: Mapping[str, int]) -> Any:
    """The library made of a folder's C files, whose functions are declared to `ffi`; built unless it exists.

    Raises
    ------
    InputError
        The C compiler is missing, or fails.
    """
    paths = sorted(folder.glob("*.c"))
    contents = b"".join(path.read_bytes() for path in (*paths, *sorted(folder.glob("*.h"))))
    words = [f"-D{name}={value}" for name, value in definitions.items()]
    key = hashlib.sha256(contents + " ".join([*compiler(), *FLAGS, *words]).encode()).hexdigest()[:16]
    target = kept(f"{folder.parent.name}-{key}", "compiling C code", lambda built: build(paths, built, words))
    return ffi.dlopen(str(target))


def kept(name: str, doing: str, make: Callable[[Path], None]) -> Path:
    """A shared library of this name in the cache folder, which `make` builds unless it exists.

    Two processes may build it at once, and one may be killed: each builds aside and renames, and nobody waits.
    """
    target = cache_folder() / f"{name}{sysconfig.get_config_var('SHLIB_SUFFIX') or '.so'}"
    if not target.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=ASIDE) as aside, stage(doing):
            built = Path(aside) / target.name
            make(built)
            with built.open("rb") as file:
                os.fsync(file.fileno())  # a machine that stops must not leave a name without its contents
            os.replace(built, target)
        for left in target.parent.glob(ASIDE + "*"):
            with suppress(OSError):
                if time.time() - left.stat().st_mtime > ABANDONED_SECONDS:
                    shutil.rmtree(left)
    return target


def build(sources: Sequence[Path], target: Path, words: Sequence[str] = ()) -> None:
    """Makes the shared library `target` of C files, with further words for the compiler; files are compiled side by
    side.

    Raises
    ------
    InputError
        The C compiler is missing, or fails.
    """
    command = [*compiler(), *FLAGS, *words, "-fPIC"]
    parts = list(sources)
    if len(parts) > 1:
        parts = [target.with_suffix(f".{number}.o") for number in range(len(sources))]
        _call([[*command, "-c", str(source), "-o", str(part)] for source, part in zip(sources, parts, strict=True)])
    _call([[*command, "-shared", *map(str, parts), "-o", str(target), "-lm"]])


def _call(commands: Sequence[Sequence[str]]) -> None:
    """Carries out command lines, as many at a time as there are cores, without threads that the process waits for."""
    waiting, running, failed = deque(commands), deque[subprocess.Popen](), list[str]()
    while waiting or running:
        while waiting and len(running) < cores():
            running.append(
                subprocess.Popen(waiting.popleft(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            )
        said = running[0].communicate()[1].strip().splitlines()
        failed += [said[-1] if said else "it prints nothing"] if running.popleft().returncode else []
    if failed:
        raise InputError(f"the C compiler {commands[0][0]} failed: {failed[0]}")


@cache
def _array_of(kind: str) -> Any:
    return ffi.typeof(f"{kind}[]")


def pointer(array: np.ndarray, kind: str = "double") -> Any:
    """A contiguous numpy array for C, kept alive for as long as what is returned."""
    return _cffi_backend.from_buffer(_array_of(kind), array)  # a third of the time of `ffi.from_buffer`


def integers(*arrays: np.ndarray) -> tuple[Any, ...]:
    """Arrays of int32 as `pointer` gives them."""
    return tuple(pointer(array, "int32_t") for array in arrays)
