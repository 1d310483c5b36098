"""The pictures of render meshes' textures, copied beside an export."""

import shutil
from pathlib import Path

from pdvol.errors import SimulationError
from pdvol.studio.export.parts import Part


def copy_texture(part: Part, folder: Path) -> str:
    """Copy the texture of a part into a folder of textures, named after it; its path from the folder above, empty where
    the part has none.

    Raises
    ------
    SimulationError
        The disk cannot be written.
    """
    if part.render is None or part.render.texture is None:
        return ""
    file = folder / f"{part.name}{part.render.texture.suffix}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(part.render.texture, file)
    except OSError as error:
        raise SimulationError(f"cannot write {file}: {error.strerror}") from error
    return f"{folder.name}/{file.name}"
