"""Materials: one UFL function in forms/ and one dataclass each, and where in a body they are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from inspect import ismethod
from typing import Any

import numpy as np
from ufl.core.expr import Expr

from pdvol.errors import InputError
from pdvol.forms import elasticity
from pdvol.scene.checks import Check, called, finite, instance, plain, positive, require, takes, vector
from pdvol.scene.element import Element
from pdvol.scene.values import Keyed, timed

MOST = 1e20  # of a modulus [Pa] or a density: a hundred million times diamond's, so a typing error
Value = float | Callable[[np.ndarray], np.ndarray]
"""A number, or a function of rest positions (n, d), as placed in the scene, that gives (n,)."""


def _poisson(name: str, value: float) -> None:
    finite(name, value)
    require(-1.0 < value < 0.5, f"{name} = {value!r} must lie between -1 and 0.5 (0.499 is the stiffest in use)")


def _own(name: str, value: Any) -> None:
    """A number or a vector."""
    vector(name, value) if isinstance(value, tuple) else finite(name, value)


LIMITS: dict[str, Check] = {
    **dict.fromkeys(("young", "density"), partial(positive, highest=MOST)),
    "poisson": _poisson,
    "damping": partial(finite, lowest=0.0),
}
"""The checks of a material's numbers; other fields are those that a law adds."""


@dataclass(frozen=True, repr=False)
class Material(Element):
    """Hyperelastic material; a law overrides `psi`. Fields that a law adds are parameters of its psi, by name.

    Each field is a number, or a function of rest positions (n, d) [m] giving (n,): evaluated on the coarsest level,
    once a cell. Those that a law adds may be vectors (d,), or functions giving (n, d): psi takes UFL vectors.

    Attributes
    ----------
    young : [Pa]; also `Keyed`, in time
    poisson : between -1 and 0.5
    density : [kg/m^3] ([kg/m^2] per metre of depth in 2D, which is plane strain)
    damping : [s]: stress per strain rate, divided by stress per strain; zero leaves it out
    """

    young: Value | Keyed
    poisson: Value = 0.4
    density: Value = 1000.0
    damping: Value = 0.0

    def __post_init__(self) -> None:
        require(not ismethod(self.psi), f"{self._named('psi')} must be a @staticmethod, as psi(F, mu, lmbda)")
        for field in fields(self):
            label, value = self._named(field.name), plain(getattr(self, field.name))
            object.__setattr__(self, field.name, value)
            require(not isinstance(value, Expr), f"{label} is UFL; give numbers, as (1.0, 0.0), or a function of X")
            timed(LIMITS.get(field.name, _own), "X")(label, value)
            if isinstance(value, Keyed):
                require(field.name == "young", f"{label} cannot be Keyed; young can")
                LIMITS["young"](f"{label}, its lowest key,", min(value.values))
                LIMITS["young"](label, max(value.values))

    @property
    def mu(self) -> float:
        """Shear modulus [Pa], where young and poisson are numbers."""
        return lame(self.young, self.poisson)[0]

    @property
    def lmbda(self) -> float:
        """First Lame parameter [Pa], where young and poisson are numbers."""
        return lame(self.young, self.poisson)[1]

    @property
    def varies(self) -> bool:
        """Whether some field is a function of position."""
        values = (getattr(self, field.name) for field in fields(self))
        return any(callable(value) and not isinstance(value, Keyed) for value in values)

    @property
    def keyed(self) -> tuple[Keyed, ...]:
        """What Young's modulus follows in time: none or one."""
        return (self.young,) if isinstance(self.young, Keyed) else ()

    def at(self, points: np.ndarray) -> dict[str, np.ndarray]:
        """All fields at rest positions (n, d) and t = 0, each (n,), vectors (n, d). Raises InputError where a function
        fails or gives a value out of range.
        """
        values = {}
        for field in fields(self):
            given, label = getattr(self, field.name), self._named(field.name)
            if callable(given) and not isinstance(given, Keyed):
                axes = (1,) if field.name in LIMITS else (1, 2)
                found = called(label, given, (points,), *(points.shape[:n] for n in axes)).astype(float)
                for worst in (found.min(), found.max()) if len(points) else ():
                    LIMITS.get(field.name, finite)(label, float(worst))
            else:
                value = given(0.0) if isinstance(given, Keyed) else given
                d, shape = points.shape[1], np.shape(value)
                require(shape in ((), (d,)), f"{label} = {value!r} must have {d} components")
                found = np.full((len(points), *shape), value, dtype=float)
            values[field.name] = found
        return values

    @classmethod
    def own_parameters(cls) -> tuple[str, ...]:
        """Names of the fields that this law adds."""
        return tuple(field.name for field in fields(cls) if field.name not in {base.name for base in fields(Material)})

    @staticmethod
    def psi(F: Any, mu: Any, lmbda: Any, *parameters: Any) -> Any:
        """Energy density [Pa] of the deformation gradient F (d, d), as UFL."""
        raise InputError("a material must define psi(F, mu, lmbda); use NeoHookean or your own subclass of Material")


def lame(young: Any, poisson: Any) -> tuple[Any, Any]:
    """Lame's mu and lmbda [Pa] of numbers or arrays."""
    return young / (2.0 * (1.0 + poisson)), young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))


@dataclass(frozen=True, repr=False)
class NeoHookean(Material):
    """Compressible Neo-Hookean law with a logarithmic volume term: infinite energy at zero volume."""

    psi = staticmethod(elasticity.neo_hookean)


@dataclass(frozen=True, repr=False)
class StVenantKirchhoff(Material):
    """Linear in Green's strain: stiffer than Neo-Hookean when pulled, and giving way below a stretch of 0.58 when
    pressed, down to a tenth of its volume, where a barrier holds it.
    """

    psi = staticmethod(elasticity.st_venant_kirchhoff)


@dataclass(frozen=True, repr=False)
class FixedCorotational(Material):
    """Linear in the stretches: rotations cost nothing, stresses stay moderate; below a tenth of its volume a barrier
    holds it.
    """

    psi = staticmethod(elasticity.fixed_corotational)


def _chooses(name: str, where: Any) -> None:
    takes(name, where, "X")
    labels = where if isinstance(where, tuple) else (where,)
    require(labels != (), f"{name} = () names no label; give a function or labels of the input mesh's cells")
    require(
        callable(where) or all(isinstance(label, int) and not isinstance(label, bool) for label in labels),
        f"{name} = {where!r} must be a function of positions or whole numbers, the labels of the input mesh's cells",
    )


@dataclass(frozen=True, repr=False)
class Region(Element):
    """A part of a body with a material of its own, chosen on the coarsest level by its cells and carried to finer ones
    by the binding.

    Attributes
    ----------
    material : Material
    where : function of rest positions (n, d), as placed, giving a mask (n,), evaluated at cell centres; or a label, or
        several, of the input mesh's cells
    """

    material: Material
    where: Callable[[np.ndarray], np.ndarray] | int | Sequence[int] | np.ndarray

    checks = {"material": instance(Material), "where": _chooses}

    @property
    def labels(self) -> tuple[int, ...]:
        """The labels it was given by, none for a function."""
        where: Any = self.where
        return () if callable(where) else where if isinstance(where, tuple) else (where,)
