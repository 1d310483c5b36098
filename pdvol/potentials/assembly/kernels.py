"""Kernels of forms over tensors that are constant in a domain, each evaluated for LANES domains at once.

FFCx writes a kernel in C, for one cell. Here it is compiled into a loop over LANES domains, whose numbers lie side by
side, and the compiler makes vector instructions of that loop. The logarithm and its like are those of glibc's libmvec
where there is one. glibc declares them only where __FAST_MATH__ is defined; nothing else of fast mathematics is used.
"""

import math
import re
from pathlib import Path

import basix.ufl
import ffcx.naming
import ffcx.options
import numpy as np
import ufl
from ffcx.codegeneration import get_include_path
from mpi4py import MPI

from pdvol import compat
from pdvol.compiled import FLAGS, build, compiler, ffi, kept, pointer
from pdvol.errors import InputError
from pdvol.native import LANES
from pdvol.parallel import on_root

# what kernels are compiled for: F is given, so the cell's shape does not matter, and an interval's costs least
UNIT = ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(1,)))
ONE_POINT = ufl.Measure("dx", domain=UNIT, metadata={"quadrature_degree": 0})

SOURCE = """
#define __FAST_MATH__
#include <math.h>
#undef __FAST_MATH__
#include <stdbool.h>
#include <stdint.h>
static inline __attribute__((always_inline)) {signature};
{code}
static const double ends[6] = {{0, 0, 0, 1, 0, 0}};
int32_t count = {count}, coefficients[] = {{{coefficients}}};
void evaluate(double *restrict A, const double *restrict w)
{{
    for (int l = 0; l < {lanes}; ++l) {{
        double own[{wide}], sums[{numbers}] = {{0}};
        for (int i = 0; i < {wide}; ++i)
            own[i] = w[i * {lanes} + l];
        {name}(sums, own, 0, ends, {nothing});
        for (int i = 0; i < {numbers}; ++i)
            A[i * {lanes} + l] = sums[i];
    }}
}}
"""
ffi.cdef("void evaluate(double *, const double *); extern int32_t count, coefficients[];")


def tensors(shape: tuple[int, ...] = ()) -> ufl.FunctionSpace:
    """Tensors that are constant in a domain."""
    return ufl.FunctionSpace(UNIT, basix.ufl.element("DG", "interval", 0, shape=shape))


class Kernel:
    """A compiled form. Construction is collective.

    Parameters
    ----------
    form : over `ONE_POINT`, of coefficients and arguments in `tensors`

    Attributes
    ----------
    function : cffi pointer to `void (double *A, const double *w)`
        The form's numbers A (numbers, LANES) from those of its coefficients w (wide, LANES).
    coefficients : the form's coefficients, in the order of w

    Raises
    ------
    InputError
        The form is zero, or the C compiler is missing or fails.
    """

    def __init__(self, comm: MPI.Comm, form: ufl.Form):
        how = f"{SOURCE} {LANES} {FLAGS} {compiler()} {sorted(ffcx.options.get_options().items())}"
        name = "form-" + ffcx.naming.compute_signature([form], how)
        self._library = ffi.dlopen(
            str(on_root(comm, lambda: kept(name, "compiling forms", lambda built: _compile(form, built))))
        )
        self.function = ffi.cast("void *", self._library.evaluate)
        places = ffi.unpack(self._library.coefficients, self._library.count)
        self.coefficients = [form.coefficients()[place] for place in places]
        self._numbers = math.prod(map(_numbers, form.arguments()))

    def evaluate(self, values: np.ndarray) -> np.ndarray:
        """The form's numbers (k, numbers) in k domains from those of its coefficients (k, wide)."""
        groups = -(-len(values) // LANES)
        w, A = np.zeros((groups * LANES, values.shape[1])), np.empty((groups, self._numbers, LANES))
        w[: len(values)] = values
        w = np.ascontiguousarray(w.reshape(groups, LANES, -1).transpose(0, 2, 1))
        given, found = pointer(w), pointer(A)
        for group in range(groups):
            self._library.evaluate(found + group * A[0].size, given + group * w[0].size)
        return A.transpose(0, 2, 1).reshape(-1, self._numbers)[: len(values)]


def _compile(form: ufl.Form, built: Path) -> None:
    code, given = compat.form_code(form), form.coefficients()
    kernel = re.search(r"(void (tabulate_tensor_\w+)\((.*?)\))\s*\{", code, re.DOTALL)
    if kernel is None:  # FFCx makes none of what is zero
        raise InputError(
            "an energy density, or a derivative of it by F, is zero; let psi depend on F, and not only linearly"
        )
    signature, name, arguments = kernel.groups()
    places = re.search(r"original_coefficient_position\w*\[\d+\] = \{(.*?)\}", code)
    kept = [int(place) for place in places[1].split(",")] if places else []
    source = SOURCE.format(
        signature=signature,
        code=code,
        name=name,
        nothing=", ".join("0" * (arguments.count(",") - 3)),
        coefficients=", ".join(map(str, kept)) or "0",
        count=len(kept),
        wide=max(1, sum(_numbers(given[place]) for place in kept)),
        numbers=math.prod(map(_numbers, form.arguments())),
        lanes=LANES,
    )
    path = built.with_suffix(".c")
    path.write_text(source)
    build([path], built, [f"-I{get_include_path()}"])


def _numbers(function: ufl.Coefficient | ufl.Argument) -> int:
    return math.prod(function.ufl_shape)
