"""The surface of each body of a level, as animation software takes it.

Vertices are those of the boundary (all of a 2D level), once each and in the input's order.
"""

import re
from collections.abc import Sequence

import numpy as np

from pdvol.store.reader import Run, RunLevel

LONGEST_NAME = 60  # characters of a body's name that are kept: file formats and their readers have limits


class BodySurface:
    """The drawn part of one body.

    Attributes
    ----------
    vertices : (k,) int64
        Of the level, ascending: the input's order.
    faces : (f, 3) int64
        Into `vertices`.
    """

    def __init__(self, level: RunLevel, body: int):
        facets = level.surface if level.rest.shape[1] == 3 else level.cells
        self.vertices, faces = np.unique(facets[level.mesh.point_bodies[facets[:, 0]] == body], return_inverse=True)
        self.faces = faces.reshape(-1, 3)


def body_surfaces(run: Run, level: RunLevel) -> list[tuple[str, BodySurface]]:
    """The surface of each body with a name that `plain_names` makes."""
    return [(name, BodySurface(level, i)) for i, name in enumerate(plain_names(run.info.get("bodies", [])))]


def plain_names(names: Sequence[str]) -> list[str]:
    """Names of letters, digits and underscores in the same order, no two alike; they begin with no digit."""
    result: list[str] = []
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", str(name))[:LONGEST_NAME] or "body"
        plain = plain if plain[0].isalpha() or plain[0] == "_" else f"_{plain}"
        free, number = plain, 0
        while free in result:
            number += 1
            free = f"{plain}_{number}"
        result.append(free)
    return result
