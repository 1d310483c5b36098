"""What reading a file leaves out, in words."""

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np

MOST_NAMED = 8  # things that a line names


def named(names: Sequence[str]) -> str:
    """The first of some names."""
    return ", ".join(names[:MOST_NAMED]) + (", ..." if len(names) > MOST_NAMED else "")


def counted(what: str, names: Sequence[str]) -> list[str]:
    """A line with the number of some things and their names; none where there is nothing."""
    return [f"{what}: {len(names):,} ({named(names)})"] if names else []


def lost_labels(labels: Sequence[str]) -> list[str]:
    """A line on labels of a surface's faces, or names of them."""
    return counted("labels of faces left out, for a surface has no regions", labels)


def face_labels(path: Path) -> list[str]:
    """Groups or else materials of an OBJ file's faces, or solids of an STL file, where there are several; names of the
    whole numbers, other than colours and flags, that each face of a PLY file has. None of other files.
    """
    data, found = path.read_bytes(), list[str]()
    for word in {".obj": ("g", "usemtl"), ".stl": ("solid",)}.get(path.suffix.lower(), ()):
        names = re.findall(rf"^[ \t]*{word}[ \t]+(\S.*?)\s*$".encode(), data, re.MULTILINE)
        found = found or [name.decode("utf-8", "replace") for name in dict.fromkeys(names)] * (len(set(names)) > 1)
    if path.suffix.lower() == ".ply":
        faces = data.partition(b"end_header")[0].partition(b"element face")[2].partition(b"element")[0]
        names = re.findall(rb"property\s+u?(?:char|short|int|int8|int16|int32)\s+(\w+)", faces)
        found = [name.decode() for name in names if name not in (b"red", b"green", b"blue", b"alpha", b"flags")]
    return found


def unread_labels(cell_data: Mapping[str, Sequence[np.ndarray]], known: Collection[str]) -> list[str]:
    """A line on whole numbers of cells, by name and block, where none are under a name that is `known` for regions."""
    if any(name in cell_data for name in known):
        return []
    own = {name: parts for name, parts in cell_data.items() if not name.startswith("vtk")}  # VTK's numbers and flags
    values = {name: np.concatenate([np.ravel(part) for part in parts]) for name, parts in own.items()}
    names = [name for name, all_ in values.items() if all_.dtype.kind in "iu" and len(np.unique(all_)) > 1]
    return counted("cell data that may be regions and is not read, rename it to region", names)
