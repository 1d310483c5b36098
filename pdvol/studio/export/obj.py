"""Moving surfaces as OBJ files, one folder a level and one file a step, and the OBJ files that other formats need."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdvol.store.files import write_bytes
from pdvol.store.reader import Run
from pdvol.store.series import LevelFields, Series
from pdvol.studio.export.files import copy_texture, made_folder
from pdvol.studio.export.parts import RENDER, Part, body_parts
from pdvol.studio.shown import linear_colour

LIBRARY = "materials.mtl"  # name of the file of materials beside the meshes


def export(run: Run, levels: Sequence[int], out: Path, fields: LevelFields, surface: str = RENDER) -> list[Path]:
    """Write `out/level_<l>/000000.obj`, `000001.obj` ..., a file a step, and materials beside them. Simulated surfaces
    come first, in the input's order, then render meshes. OBJ files hold no fields. See `pdvol.studio.export`.
    """
    folders = [out / f"level_{level}" for level in levels]
    for level, folder in zip(levels, folders, strict=True):
        series = Series(run, level)
        parts = body_parts(run, series.level, surface)
        write_materials(parts, folder)
        faces = face_lines(parts)
        for step in range(series.steps):
            series.say(step)
            write_bytes(folder / f"{step:06d}.obj", obj_text(np.concatenate([part.at(step) for part in parts]), faces))
    return folders


def obj_text(points: np.ndarray, faces: str) -> bytes:
    """An OBJ file of points (n, 3) and the `face_lines` of their parts."""
    lines = "".join("v {!r} {!r} {!r}\n".format(*row) for row in points.tolist())
    return f"mtllib {LIBRARY}\n{lines}{faces}".encode()


def face_lines(parts: Sequence[Part]) -> str:
    """The lines of parts whose vertices are one after the other: names, texture coordinates, materials and polygons."""
    lines: list[str] = []
    vertices = places = 0
    for part in parts:
        words = [str(c) for c in (part.corners + vertices + 1).tolist()]
        lines.append(f"o {part.name}")
        if part.render is not None and len(part.render.uvs):
            lines += ["vt {!r} {!r}".format(*row) for row in part.render.uvs.tolist()]
            words = [f"{c}/{t}" for c, t in zip(words, (part.render.uv_corners + places + 1).tolist(), strict=True)]
            places += len(part.render.uvs)
        lines.append(f"usemtl {part.name}")
        ends = np.cumsum(part.counts).tolist()
        lines += ["f " + " ".join(words[e - n : e]) for e, n in zip(ends, part.counts.tolist(), strict=True)]
        vertices += len(part.rest)
    return "\n".join([*lines, ""])


def write_materials(parts: Sequence[Part], folder: Path) -> None:
    """Write the colours of parts, and copy their textures, into a folder that is made where there is none."""
    text, textures = "", made_folder(folder) / "textures"
    for part in parts:
        picture = copy_texture(part, textures)
        colour = (1.0, 1.0, 1.0) if picture else linear_colour(part.colour)
        text += "newmtl {}\nKd {:.6f} {:.6f} {:.6f}\nd {:g}\n".format(part.name, *colour, part.opacity)
        text += f"map_Kd {picture}\n\n" if picture else "\n"
    write_bytes(folder / LIBRARY, text.encode())
