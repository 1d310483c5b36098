"""Surfaces that are drawn in the place of bodies: `render.json` lists them, `render/<i>.npz` holds the arrays of each.

| file | content |
|---|---|
| render.json | body, name, interpolant, texture and notes of each |
| render/<i>.npz | `points` (n, 3) at rest [m], `counts`, `corners`, `uvs`, `uv_corners`, `first`, `fans` |
| render/<i>.png, .jpg | its texture |
| levels/<l>/render_<i>.npz | `data`, `indices`, `indptr` of the weights W of a level: positions are W x |
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pdvol.errors import InputError
from pdvol.store.files import read_arrays, read_list, write_arrays, write_bytes, write_list

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_ARRAYS = ("points", "counts", "corners", "uvs", "uv_corners", "first", "fans")
_WEIGHTS = ("data", "indices", "indptr")


@dataclass(frozen=True, eq=False)
class StoredRender:
    """One stored surface.

    Attributes
    ----------
    index : its number in the run
    body : the number of its body
    name : of the body, with a number where it has several
    interpolant : that carries it
    texture : its picture, None without one
    points : (n, 3) at rest, placed [m]
    counts, corners, uvs, uv_corners : as in `pdvol.meshes.RenderSurface`
    first : (n,) the first vertex at the place of each
    fans : (k, 3) into the corners, the polygons cut into triangles
    """

    index: int
    body: int
    name: str
    interpolant: str
    texture: Path | None
    points: np.ndarray
    counts: np.ndarray
    corners: np.ndarray
    uvs: np.ndarray
    uv_corners: np.ndarray
    first: np.ndarray
    fans: np.ndarray

    @property
    def triangles(self) -> np.ndarray:
        """(k, 3) into the vertices."""
        return self.corners[self.fans]

    @property
    def welded(self) -> np.ndarray:
        """(k, 3) the same with one vertex at each place, so that seams are no holes."""
        return self.first[self.triangles]


def write_render_meshes(folder: Path, entries: Sequence[Mapping[str, Any]]) -> None:
    """Store surfaces; replaces those stored before.

    Each entry has `body`, `name`, `interpolant`, `arrays`, `texture` (bytes and the ending of a name, or None), and
    `weights`, one sparse matrix a level.
    """
    if not entries and not (folder / "render.json").exists():
        return
    write_list(folder, "render", (), ())  # while files are replaced there is none
    listed = []
    for i, entry in enumerate(entries):
        data, ending = entry["texture"] or (b"", "")
        texture = f"{i}{ending}" if data else ""
        if texture:
            write_bytes(folder / "render" / texture, data)
        for level, w in enumerate(entry["weights"]):
            write_arrays(_weights_file(folder / "levels" / str(level), i), **{key: getattr(w, key) for key in _WEIGHTS})
        listed.append({key: entry[key] for key in ("body", "name", "interpolant")} | {"texture": texture})
    write_list(folder, "render", listed, [{key: entry["arrays"][key] for key in _ARRAYS} for entry in entries])


def read_render_meshes(folder: Path) -> tuple[StoredRender, ...]:
    """The stored surfaces, none when none were stored; InputError when a file is damaged (the states do not depend on
    it).
    """

    def made(index: int, entry: dict, arrays: Mapping[str, np.ndarray]) -> StoredRender:
        texture = folder / "render" / entry["texture"] if entry["texture"] else None
        kept = (arrays[key] for key in _ARRAYS)
        return StoredRender(index, entry["body"], entry["name"], entry["interpolant"], texture, *kept)

    return read_list(folder, "render", made)


def read_render_weights(level_folder: Path, index: int, columns: int) -> "csr_matrix":
    """W (n, columns) of a level; InputError where it is missing or damaged."""
    try:
        arrays = read_arrays(_weights_file(level_folder, index), _WEIGHTS)
    except InputError as error:
        raise InputError(f"{error}; pdvol run SCENE --resume binds the render meshes again") from error
    from scipy.sparse import csr_matrix  # takes as long to load as all else that reads a run

    return csr_matrix(tuple(arrays[key] for key in _WEIGHTS), shape=(len(arrays["indptr"]) - 1, columns))


def _weights_file(level_folder: Path, index: int) -> Path:
    return level_folder / f"render_{index}.npz"
