"""A term from any UFL energy density psi(F, parameters): value, gradient and filtered Hessian through compiled kernels.

The density may depend on x through F = grad(x) alone, and on parameters that are constant per cell. First and second derivatives are
UFL's; P1 positions make every integrand constant per cell, so one quadrature point is exact.
"""

from collections.abc import Callable, Mapping

import basix.ufl
import numpy as np
import ufl
from dolfinx import jit
from scipy.sparse import csr_array

from pdvol import compat
from pdvol.forms.kinematics import deformation_gradient
from pdvol.hierarchy.level_space import LevelSpace
from pdvol.potentials import native
from pdvol.potentials.block_pattern import BlockPattern
from pdvol.potentials.native import ffi, pointer
from pdvol.potentials.potential import Positions, Term

FILTERS = {"none": 0, "clamp": 1, "abs": 2}


class CellEnergy(Term):
    """Sum over cells of volume times psi(F).

    Parameters
    ----------
    space : LevelSpace
    pattern : BlockPattern
    psi : callable (F, **parameters) -> UFL energy density [Pa]
    parameters : mapping of names to arrays (len(cells),)
    cells : (k,) local indices of owned cells
    name : str
    positive : "clamp", "abs" or "none"
        What becomes of negative eigenvalues of a cell's Hessian over F.
    """

    def __init__(self, space: LevelSpace, pattern: BlockPattern, psi: Callable, parameters: Mapping[str, np.ndarray], cells: np.ndarray,
                 name: str = "elastic", positive: str = "clamp"):
        self.space, self.pattern, self.name, self.positive = space, pattern, name, positive
        self._cells = np.ascontiguousarray(cells, dtype=np.int32)
        self._blocks = np.ascontiguousarray(space.V.dofmap.list, dtype=np.int32)
        self._cell_blocks = np.ascontiguousarray(self._blocks[self._cells])
        self._nodes = np.ascontiguousarray(compat.geometry_dofmap(space.domain), dtype=np.int32)
        self._points = np.ascontiguousarray(space.domain.geometry.x, dtype=np.float64)
        self._library = native.library()
        self._compile(psi, parameters)
        volumes = np.abs(space.mesh.volumes[space.local_cells[self._cells]])
        self.scale = space.comm.allreduce(float(sum(np.abs(values) @ volumes for values in parameters.values())))

    def _compile(self, psi, parameters) -> None:
        space = self.space
        domain, d = space.domain.ufl_domain(), space.dim
        x = ufl.Coefficient(space.V.ufl_function_space())
        constant = ufl.FunctionSpace(domain, basix.ufl.element("DG", space.domain.basix_cell(), 0))
        coefficients = {name: ufl.Coefficient(constant) for name in parameters}
        dx = ufl.Measure("dx", domain=domain, metadata={"quadrature_degree": 0})
        energy = psi(deformation_gradient(x), **coefficients) * dx
        gradient = ufl.derivative(energy, x, ufl.TestFunction(space.V.ufl_function_space()))
        hessian = ufl.derivative(gradient, x, ufl.TrialFunction(space.V.ufl_function_space()))
        columns = {x: None, **{coefficients[name]: np.asarray(values, dtype=float) for name, values in parameters.items()}}
        self._kernels = [_Kernel(space.comm, form, columns, len(self._cells), (d + 1) * d) for form in (energy, gradient, hessian)]

    def _arguments(self, order: int, x: Positions):
        kernel = self._kernels[order]
        if kernel.positions_at is not None and kernel.packed_for is not x:
            shape = (len(self._cells), -1)
            width = self._cell_blocks.shape[1] * self.space.dim
            kernel.packed[:, kernel.positions_at : kernel.positions_at + width] = x.local[self._cell_blocks].reshape(shape)
            kernel.packed_for = x
        return (kernel.function, self.space.dim, len(self._cells), pointer(self._cells, "int32_t"), pointer(self._nodes, "int32_t"),
                pointer(self._points), pointer(kernel.packed), kernel.packed.shape[1], ffi.NULL)

    def value(self, x: Positions) -> float:
        mine = self._library.cell_values(*self._arguments(0, x))
        total = self.space.comm.allreduce(mine)
        return total if np.isfinite(total) else np.inf

    def gradient(self, x: Positions) -> np.ndarray:
        local = np.zeros((len(self.space.local_points), self.space.dim))
        self._library.cell_gradients(*self._arguments(1, x), pointer(self._blocks, "int32_t"), pointer(local))
        return self.space.add_ghosts(local)

    def hessian(self, x: Positions) -> csr_array:
        d = self.space.dim
        blocks = np.zeros((self.pattern.count, d, d))
        kernel = self._kernels[2]
        mode = FILTERS[self.positive] if kernel.positions_at is not None else 0  # a Hessian without positions is that of a quadratic energy
        self._library.cell_hessians(*self._arguments(2, x), pointer(self.pattern.slots, "int32_t"), mode, kernel.positions_at or 0, pointer(blocks))
        return self.pattern.rows(blocks)


class _Kernel:
    """A compiled form's cell kernel with the array its coefficients are packed in."""

    def __init__(self, comm, form, columns, count: int, width: int):
        options = {"cffi_extra_compile_args": list(native.FLAGS), "cache_dir": str(native.cache_folder() / "forms")}
        compiled, self._module, _ = jit.ffcx_jit(comm, form, jit_options=options)
        kernel = compiled.form_integrals[0].tabulate_tensor_float64
        self.function = ffi.cast("void *", int(self._module.ffi.cast("uintptr_t", kernel)))
        self.packed_for, self.positions_at = None, None
        ordered = form.coefficients()
        used = [ordered[compiled.original_coefficient_positions[i]] for i in range(compiled.num_coefficients)]
        widths = [width if columns[c] is None else 1 for c in used]
        self.packed = np.zeros((count, sum(widths)))
        for at, coefficient in zip(np.cumsum([0, *widths]), used, strict=False):
            if columns[coefficient] is None:
                self.positions_at = int(at)
            else:
                self.packed[:, at] = columns[coefficient]
