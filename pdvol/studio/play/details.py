"""Render meshes as the page draws them: at each state where the run's own weights put them, with their textures."""

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from pdvol.errors import InputError
from pdvol.store.reader import RunLevel
from pdvol.store.render_meshes import StoredRender
from pdvol.studio.play.motion import packed_states
from pdvol.studio.play.packing import Chunks

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

TEXTURE_SIDE = 1024  # pixels of a texture's longer side: more than a pane shows of a body
TEXTURE_BYTES = 1_000_000  # of a texture's file: a PNG of this size is smaller as a JPEG
JPEG_QUALITY = 85  # of a JPEG: differences that are not seen
PLAIN = ("RGB", "RGBA", "L", "P")  # modes of pictures that every browser shows alike


class Detail:
    """A render mesh whose vertices are cut apart where its texture has a seam.

    Attributes
    ----------
    vertices : (k,) int64
        Of the render mesh.
    faces : (f, 3) int64
        Into `vertices`.
    places : (k, 2) in the texture, (0, 0) at its upper left corner; None without texture coordinates
    """

    def __init__(self, mesh: StoredRender):
        corners = mesh.fans.ravel()
        named = mesh.corners[corners]
        if not len(mesh.uvs):
            self.vertices, faces = np.unique(named, return_inverse=True)
            self.places = None
        else:
            pairs = np.column_stack([named, mesh.uv_corners[corners]])
            pairs, faces = np.unique(pairs, axis=0, return_inverse=True)
            self.vertices = pairs[:, 0]
            self.places = mesh.uvs[pairs[:, 1]] * [1.0, -1.0] + [0.0, 1.0]
        self.faces = faces.reshape(-1, 3)


def packed_details(
    level: RunLevel, meshes: Sequence[StoredRender], steps: Sequence[int], chunks: Chunks
) -> tuple[list[dict], float]:
    """Render meshes of a run on a level at some steps: `body` and, as of a level's own vertices, `low`, `span`,
    `positions` and `faces`; `texture` with `places`, or None. And a bound for coordinates [m].

    Raises
    ------
    InputError
        The weights of a level or a texture cannot be read.
    """
    found, error = [], 0.0
    for mesh in meshes:
        detail, weights = Detail(mesh), level.render_weights(mesh)
        entry = packed_states(_places(level, weights[detail.vertices]), steps, chunks)
        error = max(error, entry.pop("error"))
        entry |= {"body": mesh.body, "faces": chunks.raw(detail.faces.astype(np.uint32)), "texture": None}
        if mesh.texture is not None and detail.places is not None:
            entry["texture"] = chunks.picture(texture_bytes(mesh.texture))
            entry["places"] = chunks.raw(detail.places.astype(np.float32))
        found.append(entry)
    return found, error


def _places(level: RunLevel, weights: "csr_matrix") -> Callable[[int], np.ndarray]:
    return lambda step: weights @ level.positions(step)


def texture_bytes(path: Path) -> bytes:
    """The file of a texture, or a JPEG of it where it is larger than a page needs; InputError where it is none."""
    try:
        data = path.read_bytes()
        with Image.open(io.BytesIO(data)) as picture:
            if max(picture.size) <= TEXTURE_SIDE and len(data) <= TEXTURE_BYTES and picture.mode in PLAIN:
                return data
            small = picture.convert("RGB")
            small.thumbnail((TEXTURE_SIDE, TEXTURE_SIDE), Image.Resampling.LANCZOS)
    except (OSError, Image.DecompressionBombError) as error:
        raise InputError(f"{path} is no picture that can be read; pdvol run SCENE --resume stores it again") from error
    buffer = io.BytesIO()
    small.save(buffer, "JPEG", quality=JPEG_QUALITY)
    return buffer.getvalue()
