"""Kernels for LANES domains at once: each lane has what FFCx's own kernel of one cell gives."""

import numpy as np
import pytest
import ufl
from mpi4py import MPI

from pdvol.compat import jit
from pdvol.compiled import ffi, pointer
from pdvol.errors import InputError
from pdvol.forms.elasticity import fixed_corotational, neo_hookean, st_venant_kirchhoff
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.cell_energy import CellEnergy
from pdvol.potentials.assembly.compiled_forms import form_cache
from pdvol.potentials.assembly.domains import Domains
from pdvol.potentials.assembly.kernels import ONE_POINT, Kernel, tensors
from pdvol.potentials.assembly.native import FLAGS, LANES
from shapes import box

SAME = 1e-12
"""Relative difference that round-off and another logarithm make."""
LAWS = {
    "neo-hookean": neo_hookean,
    "st-venant-kirchhoff": st_venant_kirchhoff,
    "fixed-corotational": fixed_corotational,
    "without lmbda": lambda F, mu, lmbda: mu * ufl.inner(F, F) * ufl.ln(ufl.det(F)),
    "of one entry": lambda F, mu, lmbda: lmbda * F[0, 1] ** 2,
}


def density_form(law, d: int, order: int) -> tuple[ufl.Form, dict]:
    """A derivative of a density by F, and numbers (LANES, ...) of its coefficients; some cells are nearly flat."""
    F, mu, lmbda = ufl.Coefficient(tensors((d, d))), ufl.Coefficient(tensors()), ufl.Coefficient(tensors())
    form = law(F, mu, lmbda) * ONE_POINT
    for function in (ufl.TestFunction, ufl.TrialFunction)[:order]:
        form = ufl.derivative(form, F, function(tensors((d, d))))
    rng = np.random.default_rng(order)
    stretches = np.concatenate([rng.uniform(0.7, 1.4, (LANES - 2, d)), rng.uniform(0.2, 0.4, (2, d))])
    turn = np.linalg.qr(rng.standard_normal((LANES, d, d)))[0]
    turn[:, 0] *= np.linalg.det(turn)[:, None]
    gradients = turn @ (stretches[:, :, None] * np.eye(d)) @ turn[::-1]
    return form, {F: gradients, mu: rng.uniform(1, 2, LANES), lmbda: rng.uniform(1, 2, LANES)}


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("law", LAWS)
def test_each_lane_against_the_kernel_of_one_cell(law, d, order):
    form, values = density_form(LAWS[law], d, order)
    kernel = Kernel(MPI.COMM_SELF, form)
    w = np.concatenate([values[c].reshape(LANES, -1) for c in kernel.coefficients], axis=1)
    found = np.full(((d * d) ** order, LANES), np.nan)
    columns = np.ascontiguousarray(w.T)
    ffi.cast("void (*)(double *, const double *)", kernel.function)(pointer(found), pointer(columns))

    with form_cache(MPI.COMM_SELF, form, FLAGS) as options:
        compiled, module, _ = jit.ffcx_jit(MPI.COMM_SELF, form, jit_options=options)
    one = compiled.form_integrals[0].tabulate_tensor_float64
    spare = [module.ffi.NULL] * (len(module.ffi.typeof(one).args) - 4)
    ends, expected = np.array([0.0, 0, 0, 1, 0, 0]), np.zeros((LANES, (d * d) ** order))
    double = lambda array: module.ffi.cast("double *", array.ctypes.data)
    for own, out in zip(np.ascontiguousarray(w), expected, strict=True):
        one(double(out), double(own), module.ffi.NULL, double(ends), *spare)
    np.testing.assert_allclose(found.T, expected, rtol=0, atol=SAME * np.abs(expected).max())


@pytest.mark.parametrize("psi", [lambda F, mu: mu**2, lambda F, mu: mu * F[0, 0]])
def test_a_density_without_forces_or_stiffness_is_refused(psi):
    space = LevelSpace(box(3, 1), MPI.COMM_SELF)
    mu = np.ones(len(space.mesh.cells))
    with pytest.raises(InputError, match=r"^an energy density, or a derivative of it by F, is zero; let psi [^\n]*$"):
        CellEnergy(space, psi, {"mu": mu}, Domains(space, mu > 0.0))
