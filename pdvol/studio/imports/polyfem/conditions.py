"""Boundary and initial conditions of a PolyFEM scene as supports, motions of obstacles, gravity and velocities."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.scene import Body, Gravity, Still, Support
from pdvol.studio.imports.polyfem.document import Section
from pdvol.studio.imports.polyfem.expressions import Expression
from pdvol.studio.imports.polyfem.geometry import Meshed

SAME_PLACE = 1e-9  # of the size of the scene: points closer than this are one vertex


@dataclass(frozen=True)
class Displaced:
    """A motion by expressions of the displacement: (X, t) -> X + u(X, t + start)."""

    components: tuple[Expression, ...]
    start: float = 0.0

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        return X + np.stack([component(X, t + self.start) for component in self.components], axis=1)


@dataclass(frozen=True)
class Accelerated:
    """Minus the right-hand side (t) -> (d,)."""

    components: tuple[Expression, ...]
    start: float = 0.0

    def __call__(self, t: float) -> np.ndarray:
        return -np.array([component(np.zeros((1, 3)), t + self.start)[0] for component in self.components])


@dataclass(frozen=True)
class Starting:
    """An initial velocity by expressions of rest positions: (n, d) -> (n, d)."""

    components: tuple[Expression, ...]

    def __call__(self, X: np.ndarray) -> np.ndarray:
        return np.stack([component(X, 0.0) for component in self.components], axis=1)


@dataclass(frozen=True, eq=False)
class AmongPoints:
    """Which rest positions (n, d) are among given ones (k, d), up to a distance [m]."""

    points: np.ndarray
    distance: float

    def __call__(self, X: np.ndarray) -> np.ndarray:
        from scipy.spatial import cKDTree

        return cKDTree(self.points).query(X)[0] <= self.distance


def read_gravity(conditions: Section, dim: int, start: float) -> tuple[Gravity, ...]:
    """Gravity of the right-hand side; numbers where it does not change, none where it is left out."""
    components = components_of(conditions, "rhs", dim) if conditions.get("rhs") not in (None, []) else ()
    if any(c.variables - {"t"} for c in components):
        conditions.refuse("rhs", "pdvol's gravity depends on time alone, not on x, y, z")
    if not components:
        return ()
    changing = Accelerated(components, start)
    return (Gravity(changing if any(c.variables for c in components) else changing(0.0) + 0.0),)


def components_of(owner: Section, key: str, dim: int) -> tuple[Expression, ...]:
    """The expressions of a vector; empty where one is refused."""
    given: Any = owner.get(key, [])
    if not isinstance(given, list) or len(given) < dim or len(given) > 3:
        owner.refuse(key, f"a list of {dim} numbers or expressions is expected here")
        return ()
    found = []
    for number, value in enumerate(given[:dim]):
        try:
            found.append(Expression.read(value))
        except InputError as error:
            owner.reading.refuse(f"{owner.at(key)}[{number}]", value, str(error))
    return tuple(found) if len(found) == dim else ()


def _ids(entry: Section) -> set[int] | None:
    """The surface numbers of a condition; None for all."""
    if entry.get("id", "all") == "all":
        return None
    return set(entry.wholes("id", "all", "whole numbers or all are expected here"))


def read_dirichlet(
    conditions: Section, meshed: list[Meshed], dim: int, start: float
) -> tuple[list[Support], list[tuple[set[int] | None, Displaced]]]:
    """The supports, and the motions of obstacles by their surface numbers, the strongest first."""
    supports: list[Support] = []
    driven: dict[str, list] = {"dirichlet_boundary": [], "obstacle_displacements": []}
    size = max((float(np.abs(m.levels[0].vertices).max()) for m in meshed), default=1.0)
    for key, motions in driven.items():
        for entry in conditions.sections(key):
            ids, components = _ids(entry), components_of(entry, "value", dim)
            entry.only("dimension", ([True] * dim, [True, True, True]), "pdvol's supports hold all components")
            entry.close()
            if not components:
                continue
            motion = Displaced(components, start)
            motions.append((ids, motion))
            for m in meshed if key == "dirichlet_boundary" else ():
                points = m.selected(ids)
                if len(points):
                    still = all(not c.variables and c(np.zeros((1, 3)), 0.0)[0] == 0.0 for c in components)
                    chosen = AmongPoints(points, SAME_PLACE * size)
                    supports.append(Support(chosen, m.name, Still() if still else motion))
    return supports, [*driven["obstacle_displacements"], *driven["dirichlet_boundary"]]


def with_velocities(root: Section, bodies: list[Body | None], meshed: list[Meshed], dim: int) -> list[Body | None]:
    """The bodies with their initial velocities."""
    initial = root.section("initial_conditions")
    for entry in initial.sections("velocity"):
        ids, components = _ids(entry), components_of(entry, "value", dim)
        entry.close()
        for number, (body, m) in enumerate(zip(bodies, meshed, strict=True)):
            touched = set(m.numbers) if ids is None else set(m.numbers) & ids
            if touched and touched != set(m.numbers):
                entry.refuse("id", f"is a part of {m.path}; pdvol's velocities are those of whole bodies")
            elif touched and body is not None and components:
                bodies[number] = replace(body, velocity=Starting(components))
    initial.close()
    return bodies
