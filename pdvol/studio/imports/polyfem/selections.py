"""PolyFEM's selections: which facets or cells get which number, by where their barycentres are."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pdvol.studio.imports.polyfem.document import Section

UNSELECTED = np.iinfo(np.int32).max  # the number of facets that no selection claims, as in PolyFEM
Inside = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Selection:
    """A number, and which points (n, d) get it; or, of a threshold, a function that gives each point its number."""

    number: int
    inside: Inside | None = None
    sides: Inside | None = None


def numbers_at(selections: list[Selection], points: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """(n,) the number of each point (n, d): of the first selection that claims it, else `otherwise` (n,)."""
    numbers, open_ = otherwise.astype(np.int64), np.ones(len(points), dtype=bool)
    for selection in selections:
        found = open_ if selection.inside is None else open_ & selection.inside(points)
        numbers[found] = selection.number if selection.sides is None else selection.sides(points[found])
        open_ = open_ & ~found
    return numbers


def read_selections(owner: Section, key: str, low: np.ndarray, high: np.ndarray) -> list[Selection]:
    """The selections below a key, in their order; relative places refer to the box from `low` to `high` (d,)."""
    given = owner.get(key)
    if isinstance(given, int) and not isinstance(given, bool):
        return [Selection(given)]
    if isinstance(given, str):
        owner.refuse(key, "pdvol does not read numbers of facets or cells from files")
        return []
    return [found for entry in owner.sections(key) for found in _selection(entry, low, high)]


def _selection(entry: Section, low: np.ndarray, high: np.ndarray) -> list[Selection]:
    relative, width = entry.plain("relative", False), high - low
    if "threshold" in entry.values:
        found = [Selection(0, sides=_sides(entry, low, high))]
        entry.close()
        return found
    if "file" in entry.values or isinstance(entry.get("id"), str):
        entry.refuse("file" if "file" in entry.values else "id", "pdvol does not read numbers from files")
        return []

    def place(key: str) -> np.ndarray:
        point = entry.array(key, low.shape)
        return width * point + low if relative else point

    size = float(np.linalg.norm(width)) if relative else 1.0
    number, inside = entry.plain("id", 0), None
    if "box" in entry.values:
        corners = entry.array("box", (2, len(low)), f"two corners of {len(low)} numbers are expected here")
        first, last = corners * width + low if relative else corners
        inside = lambda p: np.all((p >= first) & (p <= last), axis=1)
    elif "center" in entry.values:
        centre, radius = place("center"), entry.plain("radius", 0.0) * size
        inside = lambda p: np.linalg.norm(p - centre, axis=1) <= radius
    elif "radius" in entry.values:
        inside = _cylinder(place("p1"), place("p2"), entry.plain("radius", 0.0) * size)
    elif "axis" in entry.values:
        inside = _halfspace(entry, relative, low, width)
    elif "normal" in entry.values:
        normal = entry.array("normal", low.shape)
        normal = normal / max(float(np.linalg.norm(normal)), np.finfo(float).tiny)
        point = place("point") if "point" in entry.values else normal * entry.plain("offset", 0.0)
        inside = lambda p: (p - point) @ normal >= 0.0
    entry.close()
    return [Selection(number, inside)]


def _cylinder(start: np.ndarray, end: np.ndarray, radius: float) -> Inside:
    height = float(np.linalg.norm(end - start))
    axis = (end - start) / max(height, np.finfo(float).tiny)

    def inside(p: np.ndarray) -> np.ndarray:
        along = (p - start) @ axis
        off = np.linalg.norm(p - start - along[:, None] * axis, axis=1)
        return (along >= 0.0) & (along <= height) & (off <= radius)

    return inside


def _halfspace(entry: Section, relative: bool, low: np.ndarray, width: np.ndarray) -> Inside:
    given = entry.get("axis")
    names = {f"{sign}{name}": turn * (k + 1) for k, name in enumerate("xyz") for sign, turn in (("", 1), ("-", -1))}
    axis = names.get(given.lower(), 0) if isinstance(given, str) else given
    if not isinstance(axis, int) or not 1 <= abs(axis) <= len(low):
        entry.refuse("axis", f"x, -x, ... or a number from 1 to {len(low)} is expected here")
        axis = 1
    k, position = abs(axis) - 1, entry.plain("position", 0.0)
    position = width[k] * position + low[k] if relative else position
    return (lambda p: p[:, k] >= position) if axis > 0 else (lambda p: p[:, k] <= position)


def _sides(entry: Section, low: np.ndarray, high: np.ndarray) -> Inside:
    """Numbers 1 to 6 of the sides of the box, in PolyFEM's order, 7 for others; each plus `id_offset`."""
    threshold, offset = entry.plain("threshold", -1.0), entry.plain("id_offset", 0)
    threshold = 1e-7 if threshold < 0.0 else threshold
    order = [(0, low), (1, low), (0, high), (1, high), (2, low), (2, high)][: 2 * len(low)]

    def sides(p: np.ndarray) -> np.ndarray:
        numbers = np.full(len(p), 7)
        for number, (k, corner) in reversed(list(enumerate(order, 1))):
            numbers[np.abs(p[:, k] - corner[k]) < threshold] = number
        return numbers + offset

    return sides
