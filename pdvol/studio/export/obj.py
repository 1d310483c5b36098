"""Moving surfaces as sequences of OBJ files, one folder a level and one file a step."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdvol.store.files import write_bytes
from pdvol.store.reader import Run
from pdvol.store.series import LevelFields, Series
from pdvol.studio.export.files import copy_texture, made_folder
from pdvol.studio.export.parts import RENDER, Part, body_parts
from pdvol.studio.shown import linear_colour

LIBRARY = "materials.mtl"  # name of the file that has the textures of render meshes, beside the steps


def export(run: Run, levels: Sequence[int], out: Path, fields: LevelFields, surface: str = RENDER) -> list[Path]:
    """Write `out/level_<l>/000000.obj` and so on; OBJ files hold no fields. See `pdvol.studio.export`."""
    return [write_obj(run, level, out / f"level_{level}", surface) for level in levels]


def write_obj(run: Run, level: int, folder: str | Path, surface: str = RENDER) -> Path:
    """Export each stored step of one level as `folder/000000.obj`, `000001.obj` ...; each file is written aside and
    renamed. Simulated surfaces come first, in the input's order, then render meshes, with their polygons and texture
    coordinates; their textures are in `folder/textures`.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    InputError
        When the level does not exist or has no state.
    SimulationError
        When the disk cannot be written.
    """
    folder, series = Path(folder), Series(run, level)
    made_folder(folder)
    parts = body_parts(run, series.level, surface)
    # One numbering for all bodies, in the input's order.
    simulated = [part.vertices for part in parts if part.vertices is not None]
    used = np.unique(np.concatenate(simulated)) if simulated else np.zeros(0, dtype=np.int64)
    following, uvs, texts = len(used), 0, []
    materials = [f"mtllib {LIBRARY}\n"] if _write_materials(parts, folder) else []
    for part in parts:
        if part.vertices is not None:
            texts.append(object_lines(part, np.searchsorted(used, part.vertices)[part.corners], None))
            continue
        own = part.render.uvs if part.render is not None else np.zeros((0, 2))
        places = part.render.uv_corners + uvs if part.render is not None and len(own) else None
        texts.append(object_lines(part, part.corners + following, places))
        following, uvs = following + len(part.rest), uvs + len(own)
    rest = "".join(texts)
    for step in range(series.steps):
        series.say(step)
        moved = [part.at(step) for part in parts]
        points = np.zeros((len(used), 3))
        for part, own in zip(parts, moved, strict=True):
            if part.vertices is not None:
                points[np.searchsorted(used, part.vertices)] = own
        points = np.concatenate([points, *(x for p, x in zip(parts, moved, strict=True) if p.vertices is None)])
        lines = "".join("v {!r} {!r} {!r}\n".format(*row) for row in points.tolist())
        write_bytes(folder / f"{step:06d}.obj", "".join([*materials, lines, rest]).encode())
    return folder


def object_lines(part: Part, corners: np.ndarray, uv_corners: np.ndarray | None) -> str:
    """The lines of a part: its name, the texture coordinates and the material of a render mesh, and its polygons.

    Parameters
    ----------
    corners, uv_corners : the numbers of vertices and texture coordinates in the file, from 0; no `uv_corners` where the
        part has none
    """
    lines = [f"o {part.name}"]
    if part.render is not None:
        lines += ["vt {!r} {!r}".format(*row) for row in part.render.uvs.tolist()]
        lines.append(f"usemtl {part.name}")
    words = [str(c) for c in (corners + 1).tolist()]
    if uv_corners is not None:
        words = [f"{c}/{t}" for c, t in zip(words, (uv_corners + 1).tolist(), strict=True)]
    ends = np.cumsum(part.counts).tolist()
    lines += ["f " + " ".join(words[end - count : end]) for end, count in zip(ends, part.counts.tolist(), strict=True)]
    return "\n".join([*lines, ""])


def _write_materials(parts: Sequence[Part], folder: Path) -> bool:
    """The file of the materials of render meshes, with their colours or textures; whether there is one."""
    lines = []
    for part in parts:
        if part.render is not None:
            picture = copy_texture(part, folder / "textures")
            colour = (1.0, 1.0, 1.0) if picture else linear_colour(part.colour)
            lines += [f"newmtl {part.name}", "Kd {:.6f} {:.6f} {:.6f}".format(*colour)]
            lines += [f"map_Kd {picture}", ""] if picture else [""]
    if lines:
        write_bytes(folder / LIBRARY, "\n".join(lines).encode())
    return bool(lines)
