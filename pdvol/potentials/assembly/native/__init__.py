"""The compiled cell loops, built once per machine with the C compiler that FFCx needs anyway."""

import hashlib
import os
import platform
import subprocess
import sysconfig
import tempfile
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
int galerkin(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks,
             const int32_t *p_starts, const int32_t *p_columns, const double *p_weights, int64_t coarse,
             const int32_t *table, double *out);
void restriction(int d, int64_t rows, const int32_t *starts, const int32_t *columns, const double *weights,
                 const double *fine, double *coarse);
void prolongation(int d, int64_t rows, const int32_t *starts, const int32_t *columns, const double *weights,
                  const double *coarse, double *fine);
int64_t inverted_cells(int d, int64_t count, const int32_t *dofs, const double *x);
double volume_step(int d, int64_t count, const int32_t *dofs, const double *x, const double *p, double keep);
"""
SOURCES = ("elements.c", "isotropic.c", "prolongations.c")

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


@cache
def library() -> Any:
    """The loaded library. Two processes may build it at once: each builds aside and renames."""
    sources = [Path(__file__).with_name(name) for name in SOURCES]
    contents = b"".join(path.read_bytes() for path in (*sources, Path(__file__).with_name("kernel.h")))
    command = [
        os.environ.get("CC") or "cc",
        *FLAGS,
        f"-DKERNEL_ARGUMENTS={compat.KERNEL_ARGUMENTS}",
        f"-DMAX_PARAMETERS={MAX_PARAMETERS}",
        f"-DMAX_ISOTROPIC_PARAMETERS={MAX_ISOTROPIC_PARAMETERS}",
        "-shared",
        "-fPIC",
    ]
    key = hashlib.sha256(contents + " ".join(command).encode()).hexdigest()[:16]
    target = cache_folder() / f"elements-{key}{sysconfig.get_config_var('SHLIB_SUFFIX') or '.so'}"
    if not target.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as aside:
            built = Path(aside) / target.name
            try:
                subprocess.run(
                    [*command, *map(str, sources), "-o", str(built), "-lm"], check=True, capture_output=True, text=True
                )
            except (OSError, subprocess.CalledProcessError) as error:
                detail = (getattr(error, "stderr", "") or str(error)).strip().splitlines()
                raise InputError(
                    f"no C compiler: {detail[-1] if detail else error}; install one (FFCx needs it too) or set CC"
                ) from None
            os.replace(built, target)
    return ffi.dlopen(str(target))


def pointer(array: np.ndarray, kind: str = "double") -> Any:
    """A contiguous numpy array for C, kept alive for as long as what is returned."""
    return ffi.from_buffer(f"{kind}[]", array)
