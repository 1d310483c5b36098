"""Elastic terms of a scene: one `CellEnergy` per law, whatever the number of bodies and regions, one for all damping,
one that keeps the cells of smoothed elements from inverting, and one per muscle. Cells do not invert. And stresses.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import reduce, wraps
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI
from scipy.linalg import expm

from pdvol.compiled import pointer
from pdvol.errors import InputError
from pdvol.forms.elasticity import GUARDED, volume_barrier
from pdvol.forms.muscles import active_fibres
from pdvol.forms.viscosity import kelvin_voigt, kelvin_voigt_model
from pdvol.levels.materials import CellMaterials, CellMuscle
from pdvol.levels.space import LevelSpace
from pdvol.native import library
from pdvol.potentials.assembly.cell_energy import CellEnergy, Density, Values, entries_of, matrix_of
from pdvol.potentials.assembly.domains import Domains
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.assembly.kernels import ONE_POINT, Kernel, tensors
from pdvol.potentials.potential import LEAST_LEFT, Positions, Rates
from pdvol.scene import Material

TRIED_STRAIN = 1e-3  # of bodies at rest, without a unit: large beside the root of round-off; its square counts as none

Shares = Callable[[float], np.ndarray]
"""What gives values (m,) of the mesh's cells at a time [s]."""


class Elastic(CellEnergy):
    """The elastic energy of all cells that follow one law. Inverted domains are not admissible, whatever the law, and
    steps are capped so that none inverts.

    Parameters
    ----------
    space, law, parameters, domains : as `CellEnergy` takes them; parameters are those at t = 0
    shares : what gives Young's modulus of the mesh's cells (m,) at a time [s] over that at t = 0, where it changes: it
        is that of the end of each step
    """

    def __init__(
        self, space: LevelSpace, law: Density, parameters: Values, domains: Domains, shares: Shares | None = None
    ):
        super().__init__(space, replace(law, oriented=True), parameters, domains)
        self._shares = shares
        if not law.psi.__module__.startswith("pdvol."):  # a law of the user's
            self._require_stable(law.material)
        self._lame = {name: parameters[name] for name in ("mu", "lmbda")}

    def set_time(self, time: float) -> None:
        """Puts Young's modulus to that of a time [s]."""
        if self._shares is not None:
            shares = self._shares(time)
            self.set_parameters({name: shares * values for name, values in self._lame.items()})

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self.set_time(t1)

    def _require_stable(self, material: str) -> None:
        """Raises InputError where the energy of bodies at rest, or its slope, is not finite, and where a cell's energy
        falls under a small strain of either sign, and keeps falling as it grows: no step would have a minimum. Of many
        cells a thousand are tried, and those with the extremes of parameters. Collective.
        """
        d, P, at, found = self.space.dim, self._density.parameters(), self._density.c.at, ""
        tried = {*range(0, len(P), 1 + len(P) // 1000), *P.argmin(axis=0), *P.argmax(axis=0)} if len(P) else ()
        P, axes = P[sorted(tried)], np.eye(d)
        in_cells = lambda F: np.hstack([P[:, :at], np.tile(F.ravel(), (len(P), 1)), P[:, at:]])
        energy = lambda strain: self._density.evaluate(in_cells(expm(strain)))[:, 0]
        bend = lambda strain: energy(TRIED_STRAIN * strain) + energy(-TRIED_STRAIN * strain)
        pairs = combinations_with_replacement(range(d), 2)
        strains = np.array([np.outer(axes[i], axes[j]) + np.outer(axes[j], axes[i]) for i, j in pairs])
        strains /= np.linalg.norm(strains, axis=(1, 2), keepdims=True)
        Q = np.array([[bend(one + other) - bend(one - other) for one in strains] for other in strains]).T
        slope = self.gradient(Positions(self.space, self.space.from_input(self.space.mesh.points)))
        if not self.space.reduce(bool(np.isfinite(Q).all() and np.isfinite(slope).all()), MPI.LAND):
            raise InputError(f"{material}.psi, or its derivative by F, is NaN or infinite at or near F = I")
        sizes, modes = np.linalg.eigh(Q)
        if len(P) and (sizes[:, 0] < -(TRIED_STRAIN**2) * sizes[:, -1]).any():
            cell = int(sizes[:, 0].argmin())
            strain = np.tensordot(modes[cell, :, 0], strains, 1)
            ways = [[energy(size * strain)[cell] for size in (0.0, sign, 2.0 * sign)] for sign in (1.0, -1.0)]
            stretches, along = np.linalg.eigh(strain)
            if any(one > two > three for one, two, three in ways):
                found = ", ".join(f"{part:z.2f}" for part in along[:, np.abs(stretches).argmax()])
        if worst := max(self.space.comm.allgather(found)):
            raise InputError(
                f"{material}.psi has no minimum near F = I: it keeps falling along ({worst}); check its terms' signs"
            )

    def max_step(
        self, x: Positions, direction: np.ndarray, until: float | None = None, gap_share: float = LEAST_LEFT
    ) -> float:
        moved = np.ascontiguousarray(self.space.with_ghosts(direction))
        return library[self.space.dim].volume_step(self._domains, pointer(x.local), pointer(moved), LEAST_LEFT)


class CellGuard(Elastic):
    """What keeps the cells of smoothed elements from inverting: the mean F of a domain can hide an inverted cell.

    It is the volume barrier of laws that give way (forms/elasticity.py), in each cell by itself: zero above a tenth of
    the cell's volume, so that it changes nothing else.
    """

    def __init__(self, space: LevelSpace, materials: CellMaterials, shares: Shares | None = None):
        def psi(F: Any, mu: Any, lmbda: Any) -> Any:
            return volume_barrier(F, 2 * mu + lmbda)

        cells = Domains(space, materials.smoothing >= 0)
        guard = Density(psi, isotropic=False, ceiling=GUARDED, material="volume barrier")
        super().__init__(space, guard, _lame(materials), cells, shares)
        self.scale = 0.0  # nothing cancels in what is zero

    def gradient(self, x: Positions) -> np.ndarray:
        return super().gradient(x) if self.value(x) else np.zeros_like(x.owned)

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        if self.value(x):
            super().add_hessian(x, weight, into)


class Damping(CellEnergy):
    """Kelvin-Voigt damping of all cells that have it, stiffness-proportional: forms/viscosity.py over one step.

    Parameters
    ----------
    shares : as `Elastic` has it
    """

    def __init__(self, space: LevelSpace, materials: CellMaterials, shares: Shares | None = None):
        d, self._shares = space.dim, shares
        self._viscosity = {name: materials.damping * values for name, values in _lame(materials).items()}
        domains = Domains(space, materials.damping > 0.0, materials.smoothing)

        def psi(F: Any, mu: Any, lmbda: Any, growth: Any, **given: Any) -> Any:
            return kelvin_voigt(F, mu, lmbda, matrix_of("c", given, d), growth, matrix_of("m", given, d))

        def model(F: Any, v: Any, w: Any, mu: Any, lmbda: Any, growth: Any, **given: Any) -> Any:
            return kelvin_voigt_model(F, v, w, mu, lmbda, matrix_of("m", given, d))

        ones, still = np.ones(len(space.mesh.cells)), np.broadcast_to(np.eye(d), (len(space.mesh.cells), d, d))
        start = {"growth": 0.0 * ones, **entries_of("c", still), **entries_of("m", still)}
        super().__init__(space, Density(psi, model), {**self._viscosity, **start}, domains, "damping")
        self.scale = 0.0  # differences are taken before they are squared: nothing large cancels

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self._at_start, self._start = x_t, self.domains.strains(x_t.local)
        self._now = 1.0 if self._shares is None else self._shares(t1)
        self.set_rates(Rates(t1 - t0))

    def set_rates(self, rates: Rates) -> None:
        # of strains, not of positions: so a turn, whose rate is one of positions alone, is not damped
        before = {e: self.domains.strains(e.x.local) for e in rates.earlier}
        C = rates.start(self._start, before.__getitem__)
        growth = rates.start(_growth(self._start), lambda e: _growth(before[e]))
        self.set_parameters({name: self._now * values / rates.duration for name, values in self._viscosity.items()})
        self.fill({"growth": growth, **entries_of("c", C), **entries_of("m", self._metrics(rates))})

    def _metrics(self, rates: Rates) -> np.ndarray:
        """(count, d, d) those of the stretches at the step's end, if all goes on as from the state before to its start;
        of those at the start where a domain's volume then falls to less than half, and without an earlier state.
        """
        d, C = self.space.dim, self._start
        for e in rates.earlier[:1]:
            end = self.domains.strains(2.0 * self._at_start.local - e.x.local)
            C = np.where((_squared_volume(end) > 0.25 * _squared_volume(C))[:, None, None], end, C)
        whole = np.tile(np.eye(3), (len(C), 1, 1))
        whole[:, :d, :d] = C
        metrics = np.empty_like(whole)
        library[d].stretch_metrics(len(C), pointer(whole), pointer(metrics))
        return metrics[:, :d, :d]


def _squared_volume(C: np.ndarray) -> np.ndarray:
    """det C (count,) of symmetric matrices (count, d, d), ten times as fast as numpy's."""
    a, b = C[:, 0, 0], C[:, 0, 1]
    minor = a * C[:, 1, 1] - b * b
    if C.shape[1] == 2:
        return minor
    c, d, e = C[:, 0, 2], C[:, 1, 2], C[:, 2, 2]
    return minor * e - d * (a * d - b * c) + c * (b * d - C[:, 1, 1] * c)


def _growth(C: np.ndarray) -> np.ndarray:
    """ln |det F| (count,) of C = F'F (count, d, d)."""
    return 0.5 * np.log(_squared_volume(C))


def _lame(materials: CellMaterials) -> dict[str, np.ndarray]:
    """mu and lmbda (m,) [Pa] of the mesh's cells at t = 0, whatever their law."""
    return {name: reduce(np.add, (values[name] for values in materials.values)) for name in ("mu", "lmbda")}


def _by_components(law: type[Material], values: Values) -> tuple[Density, Values]:
    """A law's density, and the parameters (m,) of cells: those that are vectors are given by their components. The
    law's psi takes UFL vectors with as many entries as F has rows, which for stresses in 2D are three.
    """
    vectors = {name: [f"{name}[{i}]" for i in range(v.shape[1])] for name, v in values.items() if v.ndim > 1}
    flat = {name: v for name, v in values.items() if v.ndim == 1}
    flat |= {part: v for name, parts in vectors.items() for part, v in zip(parts, values[name].T, strict=True)}

    @wraps(law.psi)
    def psi(F: Any, **given: Any) -> Any:
        vector = lambda parts: [given.pop(part) for part in parts] + [0.0] * (F.ufl_shape[0] - len(parts))
        return law.psi(F, **{name: ufl.as_vector(vector(parts)) for name, parts in vectors.items()}, **given)

    return Density(psi, material=law.__name__), flat


def elastic_terms(space: LevelSpace, materials: CellMaterials) -> tuple[CellEnergy, ...]:
    """One term per law that occurs, one that guards the cells of smoothed elements if there are any, and one for all
    damping if there is any.
    """
    shares = materials.young_shares if materials.keyed else None
    terms: list[CellEnergy] = []
    for number, (law, values) in enumerate(zip(materials.laws, materials.values, strict=True)):
        domains = Domains(space, materials.law == number, materials.smoothing)
        terms.append(Elastic(space, *_by_components(law, values), domains, shares))
    if (materials.smoothing >= 0).any():
        terms.append(CellGuard(space, materials, shares))
    if materials.damping.any():
        terms.append(Damping(space, materials, shares))
    return tuple(terms)


class ActiveFibres(CellEnergy):
    """One muscle: forms/muscles.py over its cells, with the tension of the end of the step, which is a parameter of
    cells: nothing is compiled again when it changes.

    Parameters
    ----------
    smoothing : (m,) int, optional
        As `Domains` takes it.
    """

    def __init__(self, space: LevelSpace, muscle: CellMuscle, smoothing: np.ndarray | None = None):
        d, m = space.dim, len(space.mesh.cells)
        self._muscle, self._shape = muscle, (m, d, d)

        def psi(F: Any, **tension: Any) -> Any:
            return active_fibres(F, matrix_of("tension", tension, d))

        domains = Domains(space, np.isin(np.arange(m), muscle.cells), smoothing)
        law, none = Density(psi, isotropic=False), self._tensions(np.zeros(len(muscle.cells)))
        super().__init__(space, law, none, domains, "muscle")
        self.scale = muscle.muscle.strength * space.reduce(float(domains.volumes[: domains.counted].sum()))

    def _tensions(self, tension: np.ndarray) -> dict[str, np.ndarray]:
        """The entries (m,) of tension f f' [Pa] for a tension (k,) of the muscle's cells."""
        fibres, found = self._muscle.fibres, np.zeros(self._shape)
        found[self._muscle.cells] = (tension[:, None] * fibres)[:, :, None] * fibres[:, None, :]
        return entries_of("tension", found)

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        # Every rank asks for all cells, so that a function that fails does so on all ranks.
        self.set_parameters(self._tensions(self._muscle.muscle.tension(t1, self._muscle.places)))


class CauchyStress:
    """Cauchy stresses [Pa] of one `CellEnergy`, from the energy density that was minimised, on one rank alone:
    construction compiles their kernel.

    sigma = P F' / J with P = d psi / d F. In 2D, which is plane strain, F is completed by F_33 = 1, so the stress
    across the plane is included. Cells of smoothed elements show the stress of their own F, not that of the means
    around edges, from which forces come.
    """

    def __init__(self, term: CellEnergy):
        self._mesh, self._term, d = term.space.mesh, term, term.space.dim
        self._cells = np.flatnonzero(np.isin(np.arange(len(self._mesh.cells)), term.domains.cells))
        self._gradients = self._mesh.gradients_in(self._cells)
        self._F = ufl.Coefficient(tensors((d, d)))
        self._parameters = {ufl.Coefficient(tensors()): name for name in term.parameters}
        F = ufl.variable(
            ufl.as_matrix([[self._F[i, j] if max(i, j) < d else float(i == j) for j in range(3)] for i in range(3)])
        )
        given = {name: coefficient for coefficient, name in self._parameters.items()}
        stress = ufl.diff(term.psi(F, **given), F) * F.T / ufl.det(F)
        self._kernel = Kernel(term.space.comm, ufl.inner(stress, ufl.TestFunction(tensors((3, 3)))) * ONE_POINT)

    def add_to(self, stresses: np.ndarray, positions: np.ndarray) -> None:
        """Writes the stresses (m, 3, 3) of the term's cells at positions (n, d), both in the input's order; with the
        term's parameters as they are.
        """
        cells = self._cells
        F = np.einsum("kia,kij->kaj", positions[self._mesh.cells[cells]], self._gradients)
        values = {
            coefficient: self._term.parameters[name][cells, None] for coefficient, name in self._parameters.items()
        } | {self._F: F.reshape(len(cells), -1)}
        found = self._kernel.evaluate(np.hstack([values[coefficient] for coefficient in self._kernel.coefficients]))
        stresses[cells] = found.reshape(-1, 3, 3)


def von_mises(stresses: np.ndarray) -> np.ndarray:
    """(m,) [Pa]: root of 3/2 s:s, s the deviator of stresses (m, 3, 3)."""
    deviator = stresses - np.trace(stresses, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    return np.sqrt(1.5 * np.einsum("kij,kij->k", deviator, deviator))
