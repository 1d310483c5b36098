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
from pdvol.store.files import read_arrays, read_json, write_arrays, write_bytes, write_json

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_ARRAYS = ("points", "counts", "corners", "uvs", "uv_corners", "first", "fans")


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
    write_json(folder / "render.json", {"render": []})  # while files are replaced there is none
    (folder / "render").mkdir(exist_ok=True)
    listed = []
    for i, entry in enumerate(entries):
        write_arrays(folder / "render" / f"{i}.npz", **{key: np.asarray(entry["arrays"][key]) for key in _ARRAYS})
        texture = ""
        if entry["texture"] is not None:
            data, ending = entry["texture"]
            texture = f"{i}{ending}"
            write_bytes(folder / "render" / texture, data)
        for level, w in enumerate(entry["weights"]):
            file = _weights_file(folder / "levels" / str(level), i)
            write_arrays(file, data=w.data, indices=w.indices, indptr=w.indptr)
        listed.append({key: entry[key] for key in ("body", "name", "interpolant")} | {"texture": texture})
    write_json(folder / "render.json", {"render": listed})


def read_render_meshes(folder: Path) -> tuple[StoredRender, ...]:
    """The stored surfaces, none when none were stored; InputError when a file is damaged (the states do not depend on
    it).
    """
    file = folder / "render.json"
    try:
        entries = read_json(file).get("render", [])
    except FileNotFoundError:
        return ()
    found = []
    try:
        for i, entry in enumerate(entries):
            arrays = read_arrays(folder / "render" / f"{i}.npz", _ARRAYS)
            texture = folder / "render" / entry["texture"] if entry["texture"] else None
            kept = {key: arrays[key] for key in _ARRAYS}
            found.append(StoredRender(i, entry["body"], entry["name"], entry["interpolant"], texture, **kept))
    except (KeyError, TypeError) as error:
        raise InputError(
            f"{file} is no list of render meshes; the stored states do not depend on it: remove it, or resume the run"
        ) from error
    return tuple(found)


def read_render_weights(level_folder: Path, index: int, columns: int) -> "csr_matrix":
    """W (n, columns) of a level; InputError where it is missing or damaged."""
    file = _weights_file(level_folder, index)
    try:
        arrays = read_arrays(file, ("data", "indices", "indptr"))
    except InputError as error:
        raise InputError(f"{error}; pdvol run SCENE --resume binds the render meshes again") from error
    from scipy.sparse import csr_matrix  # takes as long to load as all else that reads a run

    indptr = arrays["indptr"]
    return csr_matrix((arrays["data"], arrays["indices"], indptr), shape=(len(indptr) - 1, columns))


def render_files(folder: Path, levels: int) -> list[Path]:
    """All files of a run's render meshes with the weights of its first levels, `render.json` the last."""
    weights = [f for level in range(levels) for f in sorted((folder / "levels" / str(level)).glob("render_*.npz"))]
    own = sorted((folder / "render").glob("[0-9]*")) if (folder / "render").is_dir() else []
    return [*weights, *own, *([folder / "render.json"] if (folder / "render.json").exists() else [])]


def _weights_file(level_folder: Path, index: int) -> Path:
    return level_folder / f"render_{index}.npz"
