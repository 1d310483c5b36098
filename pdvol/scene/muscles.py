"""Muscles: parts of bodies that contract along fibres, by an activation that changes with time and place."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from pdvol.scene.checks import anything, called, direction, finite, fits, function_or, mask, positive, require
from pdvol.scene.element import Element
from pdvol.scene.loads import Where, everywhere
from pdvol.scene.values import Keyed, Vector, timed


@dataclass(frozen=True, repr=False)
class Muscle(Element):
    """A part of a body that pulls along its fibres, besides what its material does.

    The energy density is 1/2 a T |F f|^2: an active stress a T along the fibre f (second Piola-Kirchhoff), as in models
    of the heart. Cells are chosen on the coarsest level and carried to the finer ones by the binding, with the places
    at which functions are evaluated. A body may have several muscles, also in one place.

    Attributes
    ----------
    body : name
    fibre : direction at rest, of any length but zero: a vector, or a function of rest positions (n, d), as placed, that
        gives (n, d)
    strength : T, the stress [Pa] at an activation of 1
    activation : a, a number, `Keyed` numbers, a function t -> a of time [s], or a function (t, X) of time and rest
        positions (n, d) that gives (n,); not negative, and taken at the end of each step
    where : function of rest positions (n, d) giving a mask (n,), evaluated at cell centres
    """

    body: str
    fibre: Vector | Callable[[np.ndarray], np.ndarray]
    strength: float
    activation: float | Keyed | Callable[[float], float] | Callable[[float, np.ndarray], np.ndarray] = 1.0
    where: Where = everywhere

    checks = {"fibre": function_or(direction, "X"), "strength": positive, "activation": anything, "where": mask}

    def __post_init__(self) -> None:
        super().__post_init__()
        require(not isinstance(self.fibre, Keyed), "Muscle.fibre cannot be Keyed; activation can")
        if not callable(self.activation) or isinstance(self.activation, Keyed) or not fits(self.activation, 1):
            timed(partial(finite, lowest=0.0), "t", "X")("Muscle.activation", self.activation)
        if isinstance(self.activation, Keyed):
            finite("Muscle.activation, its lowest key,", min(self.activation.values), 0.0)

    def fibres(self, points: np.ndarray) -> np.ndarray:
        """(n, d) unit vectors at rest positions (n, d). InputError where a function fails or gives no direction."""
        if callable(self.fibre):
            found = called("Muscle.fibre", self.fibre, (points.copy(),), points.shape).astype(float)
        else:
            dim = points.shape[1]
            require(len(self.fibre) == dim, f"Muscle.fibre has {len(self.fibre)} components in a {dim}D scene")
            found = np.broadcast_to(np.asarray(self.fibre, dtype=float), points.shape)
        lengths = np.linalg.norm(found, axis=1)
        require(
            bool(np.isfinite(lengths).all() and (lengths > 0.0).all()),
            "Muscle.fibre gives NaN, infinity or a vector of no length",
        )
        return found / lengths[:, None]

    def tension(self, time: float, points: np.ndarray) -> np.ndarray:
        """(n,) [Pa] at a time [s] and rest positions (n, d). Raises InputError where a function fails, or gives what is
        negative or not finite.
        """
        if not callable(self.activation):
            return np.full(len(points), self.strength * self.activation)
        if fits(self.activation, 2):
            found = called("Muscle.activation", self.activation, (time, points.copy()), (len(points),)).astype(float)
        else:
            found = np.full(len(points), float(called("Muscle.activation", self.activation, (time,), ())))
        require(
            bool((np.isfinite(found) & (found >= 0.0)).all()),
            f"Muscle.activation is negative, NaN or infinite at t = {time:g} s",
        )
        return self.strength * found
