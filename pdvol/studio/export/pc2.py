"""Point caches for Blender, Maya and Houdini: PC2 files, each with a mesh as OBJ in the same order of vertices.

    level_<l>/<name>.obj      a body at rest, an obstacle at the start
    level_<l>/<name>.pc2      its vertices in every frame; none of an obstacle that rests
    level_<l>/materials.mtl   the colours, and the textures of render meshes (level_<l>/textures)
    open_in_blender.py        puts all of a level into Blender's scene

A PC2 file has 32 bytes of header: `POINTCACHE2` and a zero, then little-endian the version 1 (int32), the number of
points (int32), the first frame (float32), frames from sample to sample (float32), and the number of samples (int32).
The samples follow, float32 x y z of each point. Coordinates are the scene's own, in metres. Neither file has normals:
those of a mesh would stay where they are while its points move. `open_in_blender.py` marks creases instead.
"""

import struct
from collections.abc import Sequence
from pathlib import Path

from pdvol.store.files import write_bytes
from pdvol.store.reader import Run
from pdvol.store.series import LevelFields
from pdvol.studio.export.files import write_script, written_aside
from pdvol.studio.export.frames import FILM_RATE, Frame, even_frames, said
from pdvol.studio.export.obj import face_lines, obj_text, write_materials
from pdvol.studio.export.parts import RENDER, Part, body_parts, obstacle_parts
from pdvol.studio.shown import CREASE_ANGLE, upward_in_3d

PC2_START = struct.Struct("<12siiffi")  # the header of a PC2 file


def export(
    run: Run, levels: Sequence[int], out: Path, fields: LevelFields, fps: float | None = None, surface: str = RENDER
) -> list[Path]:
    """Write `out/level_<l>/` for each level, resampled to `fps` frames a second, and `out/open_in_blender.py`. See
    `pdvol.studio.export`.
    """
    rate = FILM_RATE if fps is None else fps
    frames = {level: even_frames(run.levels[level].steps, run.dt, rate) for level in levels}
    folders = [out / f"level_{level}" for level in levels]
    for level, folder in zip(levels, folders, strict=True):
        parts = [*body_parts(run, run.levels[level], surface), *obstacle_parts(run, run.levels[level])]
        write_materials(parts, folder)
        for part in parts:
            write_bytes(folder / f"{part.name}.obj", obj_text(part.rest, face_lines([part])))
            if part.moves:
                _write_cache(folder / f"{part.name}.pc2", part, frames[level])
    values = {"FPS": rate, "FRAMES": max(map(len, frames.values())), "LEVEL": max(levels), "CREASE_ANGLE": CREASE_ANGLE}
    return [*folders, write_script(out, "open_in_blender", UP=tuple(upward_in_3d(run).tolist()), **values)]


def _write_cache(path: Path, part: Part, frames: Sequence[Frame]) -> None:
    """Frame by frame, aside, then renamed."""
    with written_aside(path, PC2_START.size + 12 * len(part.rest) * len(frames)) as aside, open(aside, "wb") as file:
        file.write(PC2_START.pack(b"POINTCACHE2\0", 1, len(part.rest), 0.0, 1.0, len(frames)))
        for frame in said(f"{path.parent.name}/{path.name}", frames):
            file.write(frame.sampled(part.at).astype("<f4").tobytes())
