"""What a mesh file really is, by its first bytes and its counts, where its name or its header says something else."""

import mmap
import re
from pathlib import Path

from pdvol.errors import MeshError

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
"""Of UTF-8: editors on Windows put it in front of a text."""
START = 65_536
"""Bytes of a file that show its kind."""
KINDS = {
    ".stl": "an STL",
    ".ply": "a PLY",
    ".off": "an OFF",
    ".obj": "an OBJ",
    ".msh": "a Gmsh",
    ".vtk": "a legacy VTK",
    ".vtu": "a VTU",
    ".mesh": "a Medit",
    ".xdmf": "an XDMF",
}
_COUNTS = {
    ".ply": rb"element\s+\w+\s+(-\d+)",
    ".off": rb"\AOFF\s+(?:#[^\n]*\s+)*(?:\d+\s+){0,2}(-\d+)",
    ".vtk": rb"\n(?:POINTS|CELLS|CELL_TYPES|POLYGONS)\s+(-\d+)",
    ".vtu": rb"NumberOf(?:Points|Cells)=\"(-\d+)\"",
    ".mesh": rb"(?:Vertices|Tetrahedra|Triangles)\s+(-\d+)",
    ".msh": rb"\$(?:Nodes|Elements)\s+(-\d+)",
}
"""Where a count is negative, by the ending of the name."""
CONVERTERS = {
    (".fbx", ".3ds", ".dae", ".3mf"): "assimp export {path} {stem}.obj",
    (".glb", ".gltf"): "python -c \"import trimesh; trimesh.load('{path}', force='mesh').export('{stem}.obj')\"",
    (".step", ".stp", ".iges", ".igs", ".brep", ".geo"): "gmsh -3 {path} -format msh22 -o {stem}.msh",
    (".bdf", ".nas", ".med", ".unv", ".cgns"): "gmsh {path} -save -format msh22 -o {stem}.msh",
    (".inp", ".fem", ".f3grid", ".h5m", ".avs", ".su2", ".post", ".dat", ".tec", ".xml"):
        "meshio convert {path} {stem}.vtu",
}  # fmt: skip
"""Command lines that turn files of other kinds into ones that are read."""


def no_file(path: Path) -> str:
    """The message about a path that names no file."""
    order = "a scene's paths are looked for beside the scene file, then in the working folder"
    return f"{path}: there is no such file; {order}, {Path.cwd()}"


def converter(path: Path) -> str:
    """How to convert a file that is not read, as an ending of a message; empty where nothing is known."""
    suffix = path.suffix.lower()
    if suffix in (".bdf", ".nas") and path.is_file() and b"BEGIN BULK" in path.read_bytes():
        suffix = ".inp"  # Gmsh writes and reads Nastran's decks without this line, meshio those with it
    line = next((line for endings, line in CONVERTERS.items() if suffix in endings), "")
    return f"; convert it: {line.format(path=path.name, stem=path.stem)}" if line else ""


def check_kind(path: Path) -> None:
    """Raise MeshError where a file is evidently not what its name says, or promises what it does not hold."""
    size, suffix = path.stat().st_size, path.suffix.lower()
    with path.open("rb") as file:
        start = file.read(START)
    if start[:2] in (b"\xff\xfe", b"\xfe\xff") or _is_wide(start):
        raise MeshError(f"{path}: text in UTF-16; export the mesh again, or save the file as UTF-8")
    kind = _kind(start.removeprefix(BYTE_ORDER_MARK).lstrip(), start, size)
    if kind == suffix == ".off" and b"BINARY" in start.split(b"\n", 1)[0]:
        raise MeshError(f"{path}: a binary OFF file, which is not read; export the mesh as text, or as PLY")
    if kind and kind != suffix:
        raise MeshError(
            f"{path}: {KINDS[kind]} file under the name of {KINDS[suffix]} one; rename it to {path.stem}{kind}"
        )
    if suffix == ".stl" and kind != ".stl" and size >= 84 and bytes_after_stl(path) is None:
        promised, rest = int.from_bytes(start[80:84], "little"), size - 84
        raise MeshError(
            f"{path}: truncated or unreadable, it promises {promised:,} triangles and holds {rest // 50:,}"
            f"{f' and {rest % 50} bytes' if rest % 50 else ''}; export the mesh again"
        )
    if suffix == ".ply" and b"end_header" not in start:
        raise MeshError(f"{path}: unreadable or truncated (its header has no end); export the mesh again")
    if suffix in _COUNTS:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as contents:
            negative = re.search(_COUNTS[suffix], contents)
            count = negative.group(1).decode() if negative else ""
        if count:
            raise MeshError(f"{path}: unreadable, it promises a negative count ({count}); export the mesh again")


def _is_wide(start: bytes) -> bool:
    """Whether the bytes are text whose every second byte is zero."""
    some = start[:400]
    return len(some) >= 40 and any(
        not any(some[zero::2]) and all(9 <= byte < 127 for byte in some[1 - zero :: 2]) for zero in (0, 1)
    )


def _kind(text: bytes, start: bytes, size: int) -> str:
    """The ending that a file of these first bytes should have; empty where they do not show it."""
    if len(start) >= 84 and 84 + 50 * int.from_bytes(start[80:84], "little") == size:
        return ".stl"
    if text[:5].lower() == b"solid" and re.search(rb"facet|endsolid", text, re.IGNORECASE):
        return ".stl"
    if text.startswith((b"<?xml", b"<VTKFile", b"<Xdmf")):
        if found := re.search(rb"<VTKFile[^>]*\stype=.(\w+)", text):
            return ".vtu" if found.group(1) == b"UnstructuredGrid" else ""
        return ".xdmf" if b"<Xdmf" in text else ""
    beginnings = {
        ".ply": (b"ply\n", b"ply\r"),
        ".off": (b"OFF", b"COFF", b"NOFF"),
        ".msh": (b"$MeshFormat", b"$NOD"),
        ".vtk": (b"# vtk DataFile",),
        ".mesh": (b"MeshVersionFormatted",),
        ".obj": (b"v ", b"mtllib ", b"o ", b"vn ", b"vt "),
    }
    return next((kind for kind, words in beginnings.items() if text.startswith(words)), "")


def bytes_after_stl(path: Path) -> int | None:
    """Bytes after the triangles that a binary STL file promises; None where it is none, or holds fewer."""
    with path.open("rb") as file:
        start = file.read(START)
    after = path.stat().st_size - 84 - 50 * int.from_bytes(start[80:84], "little")
    text = start.removeprefix(BYTE_ORDER_MARK).lstrip()
    if len(start) < 84 or after < 0 or after > 0 and _kind(text, start, 0):
        return None
    return after
