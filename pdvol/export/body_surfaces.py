"""The surface of each body of a level, as animation software takes it.

Vertices are those of the boundary (all of a 2D level), once each and in the input's order.
"""

import re

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
    """The surface of each body with a name of letters, digits and underscores that no other body has."""
    names: list[str] = []
    for i, name in enumerate(run.info.get("bodies", [])):
        plain = re.sub(r"[^A-Za-z0-9_]", "_", str(name))[:LONGEST_NAME] or "body"
        plain = plain if plain[0].isalpha() or plain[0] == "_" else f"_{plain}"
        names.append(f"{plain}_{i}" if plain in names else plain)
    return [(name, BodySurface(level, i)) for i, name in enumerate(names)]
