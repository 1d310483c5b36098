"""Colours of a level's vertices: strain, computed from stored states, and fields that come from elsewhere."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from pdvol.geometry.level_mesh import facet_sizes, vertex_strain
from pdvol.store.reader import RunLevel
from pdvol.studio.play.motion import Skin
from pdvol.studio.play.packing import Chunks, quantised

FIELDS = {"strain": ("strain", "", 1e-3), "contact_force": ("contact force", "Pa", 1e-3)}
"""By name: what a field is called on the page, its unit, and the least value for the last colour, below which there is
only rounding. Strain is the largest |principal stretch - 1|; contact force is per area at rest, so that levels can be
compared.
"""
BRIGHTEST = 98.0  # percentile of a field's positive values that gets the last colour: single peaks hide the rest

PointField = Callable[[int], np.ndarray]
"""Values of a level's vertices at a step: (n,), or (n, d) whose lengths are shown."""


def strain(level: RunLevel) -> PointField:
    """(n,) at a step: `pdvol.geometry.level_mesh.vertex_strain`."""
    return lambda step: vertex_strain(level.mesh, level.positions(step))


def per_area(level: RunLevel, forces: PointField) -> PointField:
    """(n,) at a step: lengths of forces (n, d) [N] over the boundary's area [m^(d-1)] about each vertex at rest; zero
    where a force is not finite, and inside.
    """
    mesh, corners = level.mesh, level.surface.shape[1]
    sizes = np.repeat(facet_sizes(mesh.points, level.surface) / corners, corners)
    areas = np.bincount(level.surface.ravel(), sizes, len(mesh.points))

    def at(step: int) -> np.ndarray:
        lengths = np.nan_to_num(np.linalg.norm(forces(step), axis=1), nan=0.0, posinf=0.0)
        return np.where(areas > 0.0, lengths / np.where(areas > 0.0, areas, 1.0), 0.0)

    return at


def packed_fields(
    levels: Sequence[tuple[RunLevel, Sequence[int], Mapping[str, PointField]]], chunks: Chunks
) -> tuple[dict, list[dict]]:
    """Fields of levels at some of their steps, as whole numbers of 8 bits from 0 to one largest value for all levels.

    Returns
    -------
    tuple[dict, list of dict]
        By name: `label`, `unit` and `top`, the value of the last colour, which larger ones share; and the numbers in
        `chunks` of each level's fields, by name.
    """
    names = [name for name in FIELDS if any(name in fields for _, _, fields in levels)]
    found: dict[str, dict] = {}
    numbers: list[dict] = [{} for _ in levels]
    for name in names:
        values = {}
        for i, (level, steps, fields) in enumerate(levels):
            if name in fields:
                drawn, field = Skin(level).vertices, fields[name]
                values[i] = np.stack([field(step)[drawn] for step in steps]).astype(np.float32)
        positive = np.concatenate([v[v > 0.0] for v in values.values()])
        label, unit, least = FIELDS[name]
        top = max(float(np.percentile(positive, BRIGHTEST)), least) if len(positive) else least
        found[name] = {"label": label, "unit": unit, "top": top}
        for i, v in values.items():
            fractions = quantised(v[..., None], np.zeros(1), np.array([top]), np.uint8)
            numbers[i][name] = chunks.states(fractions)
    return found, numbers
