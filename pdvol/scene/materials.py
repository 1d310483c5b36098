"""Materials: one UFL function in forms/ and one dataclass each, and where in a body they are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.forms import elasticity
from pdvol.scene.checks import called, finite, keep_plain, positive, require, takes
from pdvol.scene.keyed import Keyed, keyed_numbers
from pdvol.scene.representation import one_line

MOST = 1e20  # of a modulus [Pa] or a density: a hundred million times diamond's, so a typing error
Value = float | Callable[[np.ndarray], np.ndarray]
"""A number, or a function of rest positions (n, d), as placed in the scene, that gives (n,)."""


@dataclass(frozen=True)
class Material:
    """Hyperelastic material; a law overrides `psi`. Fields that a law adds are parameters of its psi, by name.

    Each field is a number, or a function of rest positions (n, d) [m] giving (n,): evaluated on the coarsest level,
    once a cell.

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
    __repr__ = one_line

    def __post_init__(self) -> None:
        for field in fields(self):
            keep_plain(self, field.name)
            value = getattr(self, field.name)
            if isinstance(value, Keyed):
                require(field.name == "young", f"{type(self).__name__}.{field.name} cannot be Keyed; young can")
                keyed_numbers(f"{type(self).__name__}.young", value)
                positive(f"{type(self).__name__}.young, its lowest key,", min(value.values))
                self._check("young", max(value.values))
            elif callable(value):
                takes(f"{type(self).__name__}.{field.name}", value, "X")
            else:
                self._check(field.name, value)

    def _check(self, name: str, value: float) -> None:
        label = f"{type(self).__name__}.{name}"
        finite(label, value)
        if name in ("young", "density"):
            positive(label, value)
            require(value <= MOST, f"{label} = {value!r} must be at most {MOST:g}")
        elif name == "poisson":
            require(
                -1.0 < value < 0.5, f"{label} = {value!r} must lie between -1 and 0.5 (0.499 is the stiffest in use)"
            )
        elif name == "damping":
            finite(label, value, 0.0)

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
        """All fields at rest positions (n, d) and t = 0, each (n,). Raises InputError where a function fails or gives
        a value out of range.
        """
        values = {}
        for field in fields(self):
            given, label = getattr(self, field.name), f"{type(self).__name__}.{field.name}"
            given = given(0.0) if isinstance(given, Keyed) else given
            found = (
                called(label, given, (points,), (len(points),)).astype(float)
                if callable(given)
                else np.full(len(points), float(given))
            )
            for worst in (
                (found.min(initial=np.inf), found.max(initial=-np.inf)) if callable(given) and len(points) else ()
            ):
                self._check(field.name, float(worst))
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


@dataclass(frozen=True)
class NeoHookean(Material):
    """Compressible Neo-Hookean law with a logarithmic volume term: infinite energy at zero volume."""

    psi = staticmethod(elasticity.neo_hookean)
    __repr__ = one_line


@dataclass(frozen=True)
class StVenantKirchhoff(Material):
    """Linear in Green's strain: stiffer than Neo-Hookean when pulled, and giving way below a stretch of 0.58 when
    pressed, down to a tenth of its volume, where a barrier holds it.
    """

    psi = staticmethod(elasticity.st_venant_kirchhoff)
    __repr__ = one_line


@dataclass(frozen=True)
class FixedCorotational(Material):
    """Linear in the stretches: rotations cost nothing, stresses stay moderate; below a tenth of its volume a barrier
    holds it.
    """

    psi = staticmethod(elasticity.fixed_corotational)
    __repr__ = one_line


@dataclass(frozen=True)
class Region:
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
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "where")
        require(
            isinstance(self.material, Material),
            f"a region's material must be a Material, not {type(self.material).__name__}",
        )
        labels = self.labels
        takes("Region.where", self.where, "X")
        require(
            callable(self.where) or len(labels) > 0,
            "Region.where = () names no label; give a function or labels of the input mesh's cells",
        )
        for label in labels:
            whole = isinstance(label, (int, np.integer)) and not isinstance(label, bool)
            require(
                whole,
                f"Region.where = {self.where!r} must be a function of positions or whole numbers, the labels of the"
                " input mesh's cells",
            )

    @property
    def labels(self) -> tuple[int, ...]:
        """The labels it was given by, none for a function."""
        where: Any = self.where
        return () if callable(where) else where if isinstance(where, tuple) else (where,)
