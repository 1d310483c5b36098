"""A term from any UFL energy density psi(F, parameters): value, gradient and filtered Hessian through compiled kernels.

The density may depend on x through F = grad(x) alone, and on parameters that are constant per cell. UFL
differentiates psi by F only: positions are P1, so F is constant per cell, and in a domain of several cells it is their
mean. Either way it is linear in the positions. Isotropic
densities in 3D get their Hessians through the principal stretches (native/isotropic.c), which is many times faster;
whether a density is isotropic is found by evaluating it at rotated F. All others go through UFL's second derivatives by
F, whose negative eigenvalues take most of the time to find. A density may have a `model` of its second derivatives
instead, which is positive semi-definite by itself.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import basix.ufl
import numpy as np
import ufl
from mpi4py import MPI

from pdvol.compat import jit
from pdvol.errors import InputError
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly import native
from pdvol.potentials.assembly.compiled_forms import form_cache
from pdvol.potentials.assembly.domains import Domains
from pdvol.potentials.assembly.hessian_blocks import FILTERS, HessianBlocks
from pdvol.potentials.assembly.native import ffi, pointer
from pdvol.potentials.potential import LastStates, Positions, Term

# relative change of psi under rotations that counts as round-off: larger ones make a density anisotropic
ISOTROPY_TOLERANCE = 1e-12


class CellEnergy(Term):
    """Sum over domains (cells, or the cells around each edge) of volume times psi(F).

    Parameters
    ----------
    space : LevelSpace
    psi : callable (F, **parameters) -> UFL energy density [Pa]
    parameters : mapping of names to arrays (m,), of the mesh's cells; a domain has the volume-weighted means
    domains : Domains
    name : str
    isotropic : whether psi(Q F R) = psi(F) for all rotations; found by evaluation where not given
    material : whose density it is, for error messages
    model : callable (F, v, w, **parameters) -> UFL bilinear form [Pa] in the changes v and w of F, positive
        semi-definite; it takes the place of psi's second derivative except in unprojected Hessians
    ceiling : det F from which on psi is zero and not evaluated; zero leaves that out. For densities that are not
        declared isotropic
    oriented : whether the energy is infinite unless det F > 0 in all domains; then psi must depend on F

    Raises
    ------
    InputError
        More than `native.MAX_PARAMETERS` parameters. On all ranks, before any communication.
    """

    def __init__(
        self,
        space: LevelSpace,
        psi: Callable,
        parameters: Mapping[str, np.ndarray],
        domains: Domains,
        name: str = "elastic",
        isotropic: bool | None = None,
        material: str = "",
        model: Callable | None = None,
        ceiling: float = 0.0,
        oriented: bool = False,
    ):
        if len(parameters) > native.MAX_PARAMETERS:
            raise InputError(
                f"{material or name}: psi has {len(parameters)} parameters, at most {native.MAX_PARAMETERS} are"
                " possible; put constants into psi itself"
            )
        self.space, self.name, self._isotropic = space, name, isotropic
        self.psi, self.parameters, self.domains = psi, dict(parameters), domains
        self.stencils = (domains,)
        self._values = LastStates()
        self._domains = domains.struct(ceiling, oriented)
        means = self._means(parameters)
        counted = slice(domains.counted)
        self.scale = space.reduce(
            float(sum(np.abs(values[counted]) @ domains.volumes[counted] for values in means.values()))
        )
        self._compile(psi, model, means)

    def _means(self, parameters: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """(count,) of each domain, from values (m,) of the mesh's cells."""
        return {name: self.domains.mean(np.asarray(values, dtype=float)) for name, values in parameters.items()}

    def _compile(self, psi: Callable, model: Callable | None, parameters: Mapping[str, np.ndarray]) -> None:
        space, d = self.space, self.space.dim
        domain = space.domain.ufl_domain()
        tensors = ufl.FunctionSpace(domain, basix.ufl.element("DG", space.domain.basix_cell(), 0, shape=(d, d)))
        F, coefficients = ufl.Coefficient(tensors), _constants(space, parameters)
        density = psi(F, **coefficients) * _one_point(domain)
        v, w = ufl.TestFunction(tensors), ufl.TrialFunction(tensors)
        first = ufl.derivative(density, F, v)
        names = {F: None, **{coefficient: name for name, coefficient in coefficients.items()}}
        compiled = lambda form: _DensityKernel(space.comm, form, names, parameters, len(self.domains))
        self._density, self._first = compiled(density), compiled(first)
        self._second: _DensityKernel | None = None
        self._model = compiled(model(F, v, w, **coefficients) * _one_point(domain)) if model else None
        self._stretches: _StretchKernels | None = None
        if (
            d == 3
            and model is None
            and 0 < len(parameters) <= native.MAX_ISOTROPIC_PARAMETERS
            and (self._is_isotropic() if self._isotropic is None else self._isotropic)
        ):
            self._stretches = _StretchKernels(space, psi, parameters)
        else:
            self._second = compiled(ufl.derivative(first, F, w))

    @property
    def uses_stretches(self) -> bool:
        """Whether Hessians are computed from the stretches, many times faster: isotropic densities in 3D."""
        return self._stretches is not None

    def _is_isotropic(self) -> bool:
        """Whether psi(Q F R) = psi(F) for some arbitrary F and rotations Q, R; the same on every rank. Collective.

        It is evaluated with the parameters of the first domain, and of those where a parameter is largest: elsewhere
        the stiffness in one direction may be zero.
        """
        rng = np.random.default_rng(0)
        changes = []
        tried = {0, *np.abs(self._density.parameters).argmax(axis=0).tolist()} if len(self.domains) else ()
        for domain in sorted(tried):
            for _ in range(4):
                Q, R = (_rotation(rng) for _ in range(2))
                F = np.eye(3) + 0.2 * rng.uniform(-1, 1, (3, 3))
                one, other = (self._density.at(f, domain) for f in (F, Q @ F @ R))
                changes.append(abs(one - other) / max(abs(one), abs(other), 1e-300))
        return self.space.reduce(max(changes, default=0.0), MPI.MAX) < ISOTROPY_TOLERANCE

    def set_parameters(self, parameters: Mapping[str, np.ndarray]) -> None:
        """Sets the values (m,) of some parameters without compiling anything."""
        self.parameters.update(parameters)
        self.fill(self._means(parameters))

    def fill(self, values: Mapping[str, np.ndarray]) -> None:
        """Sets the values (count,) that the domains themselves have of some parameters."""
        self._values.clear()
        for kernel in (self._density, self._first, self._second, self._model, self._stretches):
            if kernel is not None:
                kernel.fill(values)

    def value(self, x: Positions) -> float:
        return self._values.value(x, self._sum)

    def _sum(self, x: Positions) -> float:
        total = self.space.reduce(native.library.domain_values(self._domains, self._density.c, pointer(x.local)))
        return total if np.isfinite(total) else np.inf

    def gradient(self, x: Positions) -> np.ndarray:
        local = np.zeros((len(self.space.local_points), self.space.dim))
        native.library.domain_gradients(self._domains, self._first.c, pointer(x.local), pointer(local))
        return local[: self.space.n_owned]

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        slots = pointer(into.pattern.slots[self.domains], "int32_t")
        mode, places, out = FILTERS[into.projection], (pointer(x.local), slots), into.cells
        if self._stretches is not None:
            native.library.isotropic_hessians(self._domains, self._stretches.c, *places, mode, weight, pointer(out))
        elif self._second is not None:
            kernel = self._model if mode and self._model is not None else self._second
            # A Hessian without F is that of a quadratic energy.
            mode = 0 if kernel is self._model or kernel.c.at < 0 else mode
            native.library.domain_hessians(self._domains, kernel.c, *places, mode, weight, pointer(out))


def _rotation(rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def _constants(space: LevelSpace, names: Iterable[str]) -> dict[str, ufl.Coefficient]:
    """Coefficients constant per cell, by name."""
    constant = ufl.FunctionSpace(space.domain.ufl_domain(), basix.ufl.element("DG", space.domain.basix_cell(), 0))
    return {name: ufl.Coefficient(constant) for name in names}


def _one_point(domain: ufl.Mesh) -> ufl.Measure:
    return ufl.Measure("dx", domain=domain, metadata={"quadrature_degree": 0})


class _Kernel:
    """A compiled form's cell kernel.

    Attributes
    ----------
    function : cffi pointer
    coefficients : the form's coefficients, in the kernel's order
    """

    def __init__(self, comm: MPI.Comm, form: ufl.Form):
        with form_cache(comm, form, native.FLAGS) as options:
            compiled, self._module, _ = jit.ffcx_jit(comm, form, jit_options=options)
        self._kernel = compiled.form_integrals[0].tabulate_tensor_float64
        self.function = ffi.cast("void *", int(self._module.ffi.cast("uintptr_t", self._kernel)))
        ordered = form.coefficients()
        self.coefficients = [
            ordered[compiled.original_coefficient_positions[i]] for i in range(compiled.num_coefficients)
        ]


class _DensityKernel(_Kernel):
    """A kernel of a domain's F and parameters.

    Attributes
    ----------
    parameters : (domains, k)
        In the kernel's order.
    c : the C struct of kernel and parameters
    """

    def __init__(
        self,
        comm: MPI.Comm,
        form: ufl.Form,
        names: Mapping[ufl.Coefficient, str | None],
        parameters: Mapping[str, np.ndarray],
        count: int,
    ):
        super().__init__(comm, form)
        wanted = [names[c] for c in self.coefficients]
        self._order = [name for name in wanted if name is not None]
        self.parameters = np.zeros((count, len(self._order)))
        self.fill(parameters)
        before = next((i for i, name in enumerate(wanted) if name is None), -1)  # parameters before F
        self.c = self._struct(self.parameters, before)

    def _struct(self, parameters: np.ndarray, at: int) -> Any:
        values = {"parameters": pointer(parameters), "np": len(self._order), "at": at}
        return ffi.new("density_t *", {"kernel": self.function, **values})

    def fill(self, parameters: Mapping[str, np.ndarray]) -> None:
        """Sets the values (domains,) of those parameters that the kernel takes; others are ignored."""
        for column, name in enumerate(self._order):
            if name in parameters:
                self.parameters[:, column] = parameters[name]

    def at(self, F: np.ndarray, domain: int) -> float:
        """psi [Pa] at F (3, 3) with one domain's parameters; for densities in 3D."""
        vertices, identity, one = np.arange(4, dtype=np.int32)[None], np.eye(3), np.ones(1)
        unit = ffi.new("domains_t *", {"d": 3, "count": 1, "counted": 1, "volumes": pointer(one)})
        unit.vertices, unit.gradients = pointer(vertices, "int32_t"), pointer(identity)
        own = self._struct(self.parameters[domain], self.c.at)
        return native.library.domain_values(unit, own, pointer(np.vstack([np.zeros(3), *F.T])))


class _StretchKernels:
    """First and second derivatives of psi(diag(stretches)), and the parameters; `c` is the C struct of all this."""

    def __init__(self, space: LevelSpace, psi: Callable, parameters: Mapping[str, np.ndarray]):
        domain = space.domain.ufl_domain()
        vectors = ufl.FunctionSpace(domain, basix.ufl.element("DG", space.domain.basix_cell(), 0, shape=(3,)))
        stretches, coefficients = ufl.Coefficient(vectors), _constants(space, parameters)
        F = ufl.as_matrix([[stretches[i] if i == j else 0 for j in range(3)] for i in range(3)])
        first = ufl.derivative(psi(F, **coefficients) * _one_point(domain), stretches, ufl.TestFunction(vectors))
        second = ufl.derivative(first, stretches, ufl.TrialFunction(vectors))
        places = {stretches: [0, 1, 2], **{coefficients[name]: [3 + i] for i, name in enumerate(parameters)}}
        kernels = [_Kernel(space.comm, form) for form in (first, second)]
        self._kernels = kernels
        sources = [[place for c in kernel.coefficients for place in places[c]] for kernel in kernels]
        self._arguments = np.array(sum(sources, []), dtype=np.int32)
        self._values = np.ascontiguousarray(np.column_stack(list(parameters.values())))
        self._names = tuple(parameters)
        self.c = ffi.new("stretches_t *", {"np": len(self._names), "parameters": pointer(self._values)})
        self.c.gradient, self.c.hessian = (kernel.function for kernel in kernels)
        self.c.arguments, (self.c.ng, self.c.nh) = pointer(self._arguments, "int32_t"), map(len, sources)

    def fill(self, parameters: Mapping[str, np.ndarray]) -> None:
        """Sets the values (domains,) of some parameters."""
        for name, values in parameters.items():
            self._values[:, self._names.index(name)] = values
