"""Surfaces that are drawn in the place of bodies: `render.json` lists them, `render/<i>.npz` holds the arrays of each.

| file | content |
|---|---|
| render.json | body, name, interpolant, texture and notes of each |
| render/<i>.npz | `points` (n, 3) at rest [m], `counts`, `corners`, `uvs`, `uv_corners`, `first`, `fans` |
| render/<i>.png, .jpg | its texture |
| levels/<l>/render_<i>.npz | `data`, `indices`, `indptr` of the weights W of a level: positions are W x |
"""

import re
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
_INDICES = {"corners": "points", "uv_corners": "uvs", "first": "points", "fans": "corners"}
"""Arrays of indices, and what these count."""
PUT_BACK = "put back the files as pdvol wrote them, or resume the run"


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
    notes : what of its file's textures is lost, in lines
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
    notes: tuple[str, ...]
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

    Each entry has `body`, `name`, `interpolant`, `notes`, `arrays`, `texture` (bytes and the ending of a name, or None)
    and `weights`, one sparse matrix a level.
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
        kept = {key: entry[key] for key in ("body", "name", "interpolant")}
        listed.append({**kept, "texture": texture, "notes": entry.get("notes", ())})
    write_list(folder, "render", listed, [{key: entry["arrays"][key] for key in _ARRAYS} for entry in entries])


def read_render_meshes(folder: Path, bodies: int) -> tuple[StoredRender, ...]:
    """The stored surfaces of a run with so many bodies, none when none were stored.

    Raises
    ------
    InputError
        A file is damaged, a surface is of a body that there is not, or its texture is not its file in the folder
        (the states do not depend on it).
    """

    def made(index: int, entry: dict, arrays: Mapping[str, np.ndarray]) -> StoredRender:
        body, picture, home = entry["body"], entry["texture"], folder / "render"
        if not all(isinstance(text, str) for text in (entry["name"], entry["interpolant"], picture)):
            raise TypeError
        listed = f"{folder / 'render.json'}: render mesh {index}"
        if type(body) is not int or not 0 <= body < bodies:
            raise InputError(f"{listed} is of body {body!r}, and there are {bodies}; {PUT_BACK}")
        own = not picture or re.fullmatch(rf"{index}\.\w+", picture)
        if not own or not (home / picture).resolve().is_relative_to(folder.resolve()):
            raise InputError(f"{listed} has the texture {picture!r}, which is no file of this run; {PUT_BACK}")
        for key, inner in _INDICES.items():
            found, end = arrays[key], len(arrays[inner])
            if found.dtype.kind not in "iu" or (found.size and not 0 <= found.min() <= found.max() < end):
                raise InputError(f"{home / f'{index}.npz'}: its {key} do not fit its {inner}; {PUT_BACK}")
        kept = (arrays[key] for key in _ARRAYS)
        notes = tuple(map(str, entry.get("notes", ())))
        return StoredRender(
            index, body, entry["name"], entry["interpolant"], home / picture if picture else None, notes, *kept
        )

    return read_list(folder, "render", made)


def read_render_weights(level_folder: Path, index: int, columns: int) -> "csr_matrix":
    """W (n, columns) of a level; InputError where it is missing or damaged."""
    try:
        arrays = read_arrays(_weights_file(level_folder, index), _WEIGHTS)
        from scipy.sparse import csr_matrix  # takes as long to load as all else that reads a run

        weights = csr_matrix(tuple(arrays[key] for key in _WEIGHTS), shape=(len(arrays["indptr"]) - 1, columns))
        weights.check_format(full_check=True)
        return weights
    except ValueError as error:  # also an InputError
        place = "" if isinstance(error, InputError) else f"{_weights_file(level_folder, index)} is damaged: "
        raise InputError(f"{place}{error}; pdvol run SCENE --resume binds the render meshes again") from error


def _weights_file(level_folder: Path, index: int) -> Path:
    return level_folder / f"render_{index}.npz"
