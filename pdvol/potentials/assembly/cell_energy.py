"""A term from any UFL energy density psi(F, parameters): value, gradient and filtered Hessian through compiled kernels.

The density may depend on x through F = grad(x) alone, and on parameters that are constant per cell. UFL
differentiates psi by F only: positions are P1, so F is constant per cell, and in a domain of several cells it is their
mean. Either way it is linear in the positions. Isotropic densities in 3D get their Hessians through the principal
stretches (native/isotropic.c), which is many times faster; whether a density is isotropic is found by evaluating it at
rotated F. All others go through UFL's second derivatives by F, whose negative eigenvalues take most of the time to
find. A density may have a `model` of its second derivatives instead, which is positive semi-definite by itself.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from pdvol.compiled import ffi, pointer
from pdvol.errors import InputError
from pdvol.levels.space import LevelSpace
from pdvol.native import LANES, MAX_PARAMETERS, library
from pdvol.potentials.assembly.domains import Domains
from pdvol.potentials.assembly.hessian_blocks import FILTERS, HessianBlocks
from pdvol.potentials.assembly.kernels import ONE_POINT, Kernel, tensors
from pdvol.potentials.potential import Positions, Term

# relative change of psi under rotations that counts as round-off: larger ones make a density anisotropic
ISOTROPY_TOLERANCE = 1e-12
Values = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Density:
    """An energy density.

    Attributes
    ----------
    psi : callable (F, **parameters) -> UFL energy density [Pa]
    model : callable (F, v, w, **parameters) -> UFL bilinear form [Pa] in the changes v and w of F, positive
        semi-definite; it takes the place of psi's second derivative where negative eigenvalues are cut off
    isotropic : whether psi(Q F R) = psi(F) for all rotations; found by evaluation where not given
    ceiling : det F from which on psi is zero and not evaluated; zero leaves that out. For densities that are not
        declared isotropic
    oriented : whether the energy is infinite unless det F > 0 in all domains; then psi must depend on F
    material : whose density it is, for error messages
    """

    psi: Callable
    model: Callable | None = None
    isotropic: bool | None = None
    ceiling: float = 0.0
    oriented: bool = False
    material: str = ""


class CellEnergy(Term):
    """Sum over domains (cells, or the cells around each edge) of volume times psi(F).

    Parameters
    ----------
    parameters : mapping of names to arrays (m,), of the mesh's cells; a domain has the volume-weighted means

    Attributes
    ----------
    stretches : kernels by which Hessians are computed, many times faster, of isotropic densities in 3D; else none

    Raises
    ------
    InputError
        More than `pdvol.native.MAX_PARAMETERS` parameters. On all ranks, before any communication.
    """

    def __init__(
        self, space: LevelSpace, density: Density, parameters: Values, domains: Domains, name: str = "elastic"
    ):
        if len(parameters) > MAX_PARAMETERS:
            raise InputError(
                f"{density.material or name}: psi has {len(parameters)} parameters, at most {MAX_PARAMETERS} are"
                " possible; put constants into psi itself"
            )
        self.space, self.name, self.stencils = space, name, (domains,)
        self.psi, self.parameters, self.domains = density.psi, dict(parameters), domains
        self._version = 0  # of the domains' own values
        self._domains = domains.struct(density.ceiling, density.oriented)
        means, counted = self._means(parameters), slice(domains.counted)
        sizes = (np.abs(values[counted]) @ domains.volumes[counted] for values in means.values())
        self.scale = space.reduce(float(sum(sizes)))
        self._compile(density, means)

    def _means(self, parameters: Values) -> dict[str, np.ndarray]:
        """(count,) of each domain, from values (m,) of the mesh's cells."""
        return {name: self.domains.mean(np.asarray(values, dtype=float)) for name, values in parameters.items()}

    def _compile(self, law: Density, parameters: Values) -> None:
        space, d, psi, model = self.space, self.space.dim, law.psi, law.model
        F, v, w = (kind(tensors((d, d))) for kind in (ufl.Coefficient, ufl.TestFunction, ufl.TrialFunction))
        coefficients = {name: ufl.Coefficient(tensors()) for name in parameters}
        names = {coefficient: name for name, coefficient in coefficients.items()}
        compiled = lambda form: _Compiled(space.comm, form, names, parameters, len(self.domains))
        density = psi(F, **coefficients) * ONE_POINT
        first = ufl.derivative(density, F, v)
        self._density, self._first = compiled(density), compiled(first)
        self._second: _Compiled | None = None
        self._model = compiled(model(F, v, w, **coefficients) * ONE_POINT) if model else None
        self.stretches: tuple[_Compiled, ...] = ()
        bystretches = d == 3 and model is None and parameters
        if bystretches and (self._is_isotropic() if law.isotropic is None else law.isotropic):
            s, one, other = (kind(tensors((3,))) for kind in (ufl.Coefficient, ufl.TestFunction, ufl.TrialFunction))
            diagonal = ufl.as_matrix([[s[i] if i == j else 0 for j in range(3)] for i in range(3)])
            slope = ufl.derivative(psi(diagonal, **coefficients) * ONE_POINT, s, one)
            self.stretches = compiled(slope), compiled(ufl.derivative(slope, s, other))
        else:
            self._second = compiled(ufl.derivative(first, F, w))

    def _is_isotropic(self) -> bool:
        """Whether psi(Q F R) = psi(F) for some arbitrary F, near rest and far from it, and rotations Q, R; the same on
        every rank. Collective.

        It is evaluated with the parameters of the first domain, and of those where a parameter is largest: elsewhere
        the stiffness in one direction may be zero.
        """
        rng = np.random.default_rng(0)
        changes = []
        tried = {0, *np.abs(self._density.parameters()).argmax(axis=0).tolist()} if len(self.domains) else ()
        for domain in sorted(tried):
            for most in (1.2, 1.2, 2.0, 2.0, 4.0, 4.0):  # stretches
                Q, R = (_rotation(rng) for _ in range(2))
                F = _rotation(rng) @ np.diag(most ** rng.uniform(-1, 1, 3)) @ _rotation(rng)
                one, other = (self._density.at(f, domain) for f in (F, Q @ F @ R))
                if np.isfinite(one) or np.isfinite(other):  # a law may end at some stretch
                    changes.append(abs(one - other) / max(abs(one), abs(other), 1e-300))
        return self.space.reduce(max(changes, default=0.0), MPI.MAX) < ISOTROPY_TOLERANCE

    def set_parameters(self, parameters: Values) -> None:
        """Sets the values (m,) of some parameters without compiling anything."""
        self.parameters.update(parameters)
        self.fill(self._means(parameters))

    def fill(self, values: Mapping[str, np.ndarray]) -> None:
        """Sets the values (count,) that the domains themselves have of some parameters."""
        self._version += 1
        lanes = {name: _in_lanes(of_name) for name, of_name in values.items()}
        for kernel in (self._density, self._first, self._second, self._model, *self.stretches):
            if kernel is not None:
                kernel.fill(lanes)

    def value(self, x: Positions) -> float:
        return x.get((self, "value"), lambda: self._sum(x), self._version)

    def _sum(self, x: Positions) -> float:
        mine = library[self.space.dim].domain_values(self._domains, self._density.c, pointer(x.local))
        return self.space.reduce(mine)

    def gradient(self, x: Positions) -> np.ndarray:
        local = np.zeros((len(self.space.local_points), self.space.dim))
        library[self.space.dim].domain_gradients(self._domains, self._first.c, pointer(x.local), pointer(local))
        return local[: self.space.n_owned]

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        slots = pointer(into.pattern.slots[self.domains], "int32_t")
        mode, places, out = FILTERS[into.projection], (pointer(x.local), slots), into.cells
        if self.stretches:
            kernels = (kernel.c for kernel in self.stretches)
            library[self.space.dim].isotropic_hessians(self._domains, *kernels, *places, mode, weight, pointer(out))
        elif self._second is not None:
            kernel = self._model if into.projection == "clamp" and self._model is not None else self._second
            # A Hessian without F is that of a quadratic energy.
            mode = 0 if kernel is self._model or kernel.c.at < 0 else mode
            library[self.space.dim].domain_hessians(self._domains, kernel.c, *places, mode, weight, pointer(out))


def entries_of(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Parameters: the entries (n,) of symmetric matrices (n, d, d), by their names."""
    return {f"{name}{i}{j}": values[:, i, j] for i, j in combinations_with_replacement(range(values.shape[1]), 2)}


def matrix_of(name: str, parameters: Mapping[str, Any], d: int) -> Any:
    """The symmetric matrix (d, d) of UFL whose entries are these parameters."""
    return ufl.as_matrix([[parameters[f"{name}{min(i, j)}{max(i, j)}"] for j in range(d)] for i in range(d)])


def _rotation(rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def _in_lanes(values: np.ndarray) -> np.ndarray:
    """(blocks, LANES): values (domains,) of LANES domains side by side; the last one's again where there is none."""
    count = len(values)
    padded = np.empty(-(-count // LANES) * LANES)
    padded[:count], padded[count:] = values, values[-1:]
    return padded.reshape(-1, LANES)


class _Compiled(Kernel):
    """A kernel of psi's argument, F or the stretches, and the domains' parameters; `c` is the C struct of both."""

    def __init__(
        self,
        comm: MPI.Comm,
        form: ufl.Form,
        names: Mapping[ufl.Coefficient, str],
        parameters: Mapping[str, np.ndarray],
        count: int,
    ):
        super().__init__(comm, form)
        wanted = [names.get(coefficient) for coefficient in self.coefficients]
        self._names, self._count = [name for name in wanted if name is not None], count
        self._blocks = np.zeros((-(-count // LANES), len(self._names), LANES))
        self.fill({name: _in_lanes(values) for name, values in parameters.items()})
        at = wanted.index(None) if None in wanted else -1
        self.c = self._struct(self._blocks, at)

    def _struct(self, blocks: np.ndarray, at: int) -> Any:
        values = {"parameters": pointer(blocks), "np": len(self._names), "at": at}
        return ffi.new("density_t *", {"kernel": self.function, **values})

    def fill(self, lanes: Mapping[str, np.ndarray]) -> None:
        """Sets the values (`_in_lanes`) of those parameters that the kernel takes; others are ignored."""
        for place, name in enumerate(self._names):
            if name in lanes:
                self._blocks[:, place] = lanes[name]

    def parameters(self) -> np.ndarray:
        """(domains, k), in the kernel's order."""
        return self._blocks.transpose(0, 2, 1).reshape(-1, len(self._names))[: self._count]

    def at(self, F: np.ndarray, domain: int) -> float:
        """psi [Pa] at F (3, 3) with one domain's parameters; for densities in 3D."""
        vertices, identity, one = np.arange(4, dtype=np.int32)[None], np.eye(3), np.ones(1)
        unit = ffi.new("domains_t *", {"count": 1, "counted": 1, "volumes": pointer(one)})
        unit.vertices, unit.gradients = pointer(vertices, "int32_t"), pointer(identity)
        own = self._struct(np.repeat(self.parameters()[domain][:, None], LANES, axis=1), self.c.at)
        return library[3].domain_values(unit, own, pointer(np.vstack([np.zeros(3), *F.T])))
