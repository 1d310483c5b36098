"""The compiled cell loops, and how C code is built: once per machine, with the C compiler that FFCx needs anyway."""

import hashlib
import os
import platform
import subprocess
import sysconfig
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import cffi
import numpy as np

from pdvol import compat
from pdvol.errors import InputError

# options of the C compiler: vector instructions of this processor, no fused multiply-add, so that sums repeat on one
# kind of processor, and no errno or traps, which would prevent vectorisation
FLAGS = ("-O3", "-march=native", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")

# parameters of an energy density: the C code keeps those of one cell on the stack
MAX_PARAMETERS = 64
# the same for isotropic densities, whose kernels run for eight cells at a time; those with more take the general path
MAX_ISOTROPIC_PARAMETERS = 16

_DECLARATIONS = """
double cell_values(void *kernel, int d, int64_t count, const int32_t *dofs, const double *x, const double *inverse,
                   const double *volumes, const double *parameters, int np, int at);
void cell_gradients(void *kernel, int d, int64_t count, const int32_t *dofs, const double *x, const double *inverse,
                    const double *volumes, const double *parameters, int np, int at, double *out);
int64_t cell_hessians(void *kernel, int d, int64_t count, const int32_t *dofs, const double *x, const double *inverse,
                      const double *volumes, const double *parameters, int np, int at, const int32_t *slots, int mode,
                      double weight, double *out);
int64_t isotropic_hessians(void *gradient, void *hessian, const int32_t *arguments, int ng, int nh, int64_t count,
                           const int32_t *dofs, const double *x, const double *inverse, const double *volumes,
                           const double *parameters, int np, const int32_t *slots, int mode, double weight,
                           double *out);
int64_t merge_pairs(int d, int64_t rows, int64_t first, int64_t n, const int32_t *cell_starts,
                    const int32_t *cell_columns, const double *cells, int64_t pairs, const int64_t *pair_rows,
                    const int64_t *pair_columns, const double *pair_blocks, const uint8_t *fixed, int32_t *starts,
                    int32_t *columns, double *blocks);
int64_t inverted_cells(int d, int64_t count, const int32_t *dofs, const double *x);
double volume_step(int d, int64_t count, const int32_t *dofs, const double *x, const double *p, double keep);
"""

ffi = cffi.FFI()
ffi.cdef(_DECLARATIONS)


@cache
def cache_folder() -> Path:
    """Where compiled code is kept: one folder per kind of processor, since it is compiled for the one at hand."""
    try:
        cpu = next(line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("flags"))
    except (OSError, StopIteration):
        cpu = platform.processor()
    key = hashlib.sha256(f"{platform.machine()} {cpu}".encode()).hexdigest()[:12]
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "pdvol" / "compiled" / key


def build(folder: Path, definitions: Mapping[str, int] | None = None) -> str:
    """Path of the library made of a folder's C files, which is built unless it exists.

    Two processes may build it at once: each builds aside and renames. Raises InputError without a C compiler.
    """
    paths = sorted(folder.glob("*.c"))
    contents = b"".join(path.read_bytes() for path in (*paths, *sorted(folder.glob("*.h"))))
    words = [f"-D{name}={value}" for name, value in (definitions or {}).items()]
    command = [os.environ.get("CC") or "cc", *FLAGS, *words, "-shared", "-fPIC"]
    key = hashlib.sha256(contents + " ".join(command).encode()).hexdigest()[:16]
    name = f"{folder.parent.name}-{key}{sysconfig.get_config_var('SHLIB_SUFFIX') or '.so'}"
    target = cache_folder() / name
    if not target.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as aside:
            built = Path(aside) / target.name
            try:
                subprocess.run(
                    [*command, *map(str, paths), "-o", str(built), "-lm"], check=True, capture_output=True, text=True
                )
            except (OSError, subprocess.CalledProcessError) as error:
                detail = (getattr(error, "stderr", "") or str(error)).strip().splitlines()
                raise InputError(
                    f"no C compiler: {detail[-1] if detail else error}; install one (FFCx needs it too) or set CC"
                ) from None
            os.replace(built, target)
    return str(target)


@cache
def library() -> Any:
    """The loaded library of the cell loops."""
    definitions = {
        "KERNEL_ARGUMENTS": compat.KERNEL_ARGUMENTS,
        "MAX_PARAMETERS": MAX_PARAMETERS,
        "MAX_ISOTROPIC_PARAMETERS": MAX_ISOTROPIC_PARAMETERS,
    }
    return ffi.dlopen(build(Path(__file__).parent, definitions))


def pointer(array: np.ndarray, kind: str = "double") -> Any:
    """A contiguous numpy array for C, kept alive for as long as what is returned."""
    return ffi.from_buffer(f"{kind}[]", array)
