"""Reads meshes of USD and Alembic files, in a child process: animations, and shapes as they are at first."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TypeVar

import numpy as np

from pdvol.errors import InputError
from pdvol.meshes import Surface
from pdvol.meshing.losses import counted
from pdvol.meshing.readers import read_in_child_process
from pdvol.scene.point_caches import ALEMBIC_FILES
from pdvol.studio.imports.alembic_caches import AlembicFile
from pdvol.studio.imports.animated_meshes import (
    AnimatedMesh,
    SceneFile,
    chosen_meshes,
    joined_meshes,
    require_meshes,
)
from pdvol.studio.imports.usd_caches import UsdFile

READERS: dict[str, tuple[Callable[[Path], SceneFile], str, str]] = {
    "Alembic": (AlembicFile, "alembic3d.AbcGeom", "alembic3d"),
    "USD": (UsdFile, "pxr.UsdGeom", "usd-core"),
}
"""By kind of file: its class, the module that this needs, and the package that has it."""
Result = TypeVar("Result")


def read_animation(path: Path, prim: str = "", fps: float | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (k,) [s], points (k, n, 3) [m] and triangles (t, 3) of the mesh that `prim` names, of all below it, or of
    the only one. `fps` replaces the file's own rate. A mesh that rests has one frame.

    Raises
    ------
    InputError
        The file is damaged or has no such mesh, its points change in number, or the package that reads it is missing.
    """
    mesh = read_in_child_process(path, _animation, prim, fps, loads=_module(path))
    return mesh.times, mesh.points, mesh.triangles()


def read_still(path: Path) -> tuple[Surface, list[str]]:
    """All meshes of a file that pictures show, at the first of its times, as one surface, and notes.

    Raises
    ------
    InputError
        The file is damaged or has no meshes, or the package that reads it is missing.
    """
    return read_in_child_process(path, _still, loads=_module(path))


def _animation(path: Path, prim: str, fps: float | None) -> AnimatedMesh:
    return _opened(path, lambda file: joined_meshes(file, chosen_meshes(file, prim), fps or file.rate))


def _still(path: Path) -> tuple[Surface, list[str]]:
    return _opened(path, _joined)


def _joined(file: SceneFile) -> tuple[Surface, list[str]]:
    require_meshes(file)
    shown = [name for name in file.names if file.drawn(name)] or list(file.names)
    mesh = joined_meshes(file, shown, first=True)
    left = [name for name in file.names if name not in set(shown)]
    groups = list(dict.fromkeys(group for name in shown for group in file.groups(name)))
    notes = [
        *counted("meshes that are read as one surface", shown if len(shown) > 1 else []),
        *counted("meshes left out, which pictures do not show", left),
        *counted("groups of faces left out, for a surface has no regions", groups),
        *file.lost,
    ]
    notes += ["it moves, and its first frame is read"] if mesh.moves else []
    return Surface(mesh.points[0], mesh.triangles().astype(np.int32)), notes


def _opened(path: Path, use: Callable[[SceneFile], Result]) -> Result:
    """What `use` gives of an open file."""
    kind = _kind(path)
    try:
        return use(READERS[kind][0](path))
    except (RuntimeError, ValueError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: unreadable as {kind} ({reason}); export it again") from error


def _kind(path: Path) -> str:
    return "Alembic" if path.suffix.lower() in ALEMBIC_FILES else "USD"


def _module(path: Path) -> str:
    """The module that a file needs; InputError where it is not installed."""
    kind = _kind(path)
    _, module, package = READERS[kind]
    if find_spec(module.partition(".")[0]) is None:
        raise InputError(f"{kind} files need the package {package}: pip install {package}, or pdvol[{kind.lower()}]")
    return module
