"""PLY files of any order of bytes, with polygons of various numbers of corners: trimesh and meshio want one number."""

import re
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import MeshError
from pdvol.meshing.polygons import cut_faces

_NAMES = "char int8 uchar uint8 short int16 ushort uint16 int int32 uint uint32 float float32 double float64"
LETTERS = dict(zip(_NAMES.split(), "bbBBhhHHiiIIffdd", strict=True))
"""Letters of `struct` and numpy for PLY's types of numbers."""
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def read_ply(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles, polygons cut. Whatever comes after the promised data is left out.

    Raises
    ------
    MeshError
        It holds less than its header promises.
    """
    data = path.read_bytes()
    end = data.index(b"end_header") + len(b"end_header")
    order, elements = "", list[tuple[str, int, list[tuple[str, ...]]]]()
    for word, *rest in filter(None, map(str.split, data[:end].decode("latin-1").splitlines())):
        if word == "format":
            order = BYTE_ORDERS.get(rest[0], "")
        elif word == "element":
            elements.append((rest[0], int(rest[1]), []))
        elif word == "property":  # its name, the letter of a list's length, and that of its numbers
            kinds = [LETTERS[kind] if order else "d" for kind in rest[rest[0] == "list" : -1]]
            elements[-1][2].append((rest[-1], *kinds))
    if order:
        end += len(re.match(rb"[ \t]*(\r\n|\n|\r|)", data[end:])[0])  # type: ignore[index]
    else:  # a row is a line; its numbers become binary ones
        lines = [line for line in data[end:].splitlines() if line.strip()]
        words = b" ".join(lines[: sum(count for _, count, _ in elements)]).split()
        data, end, order = np.array(words, dtype=float).tobytes(), 0, "="
    found: dict[str, dict] = {}
    for name, count, properties in elements:
        if found.keys() >= {"vertex", "face"}:
            break
        found[name], end = _columns(data, end, order, count, properties)
        held = min(map(len, found[name].values()), default=count)
        if held < count:
            lack = f"it promises {count:,} {'vertices' if name == 'vertex' else f'{name}s'} and holds {held:,}"
            raise MeshError(f"{path}: truncated, {lack}; export the mesh again")
    points = np.column_stack([np.ravel(found["vertex"][axis]) for axis in "xyz"]).astype(float)
    if "face" not in found and "tristrips" in (name for name, _, _ in elements):
        raise MeshError(f"{path}: its triangles are strips (tristrips), which are not read; export faces")
    faces = found.get("face", {})
    return points, cut_faces(points, faces.get("vertex_indices", faces.get("vertex_index", ())))


def _columns(data: bytes, place: int, order: str, count: int, properties: list) -> tuple[dict[str, Any], int]:
    """The rows of an element as columns by name, as many as there are, and the place behind them."""
    if all(len(one) == 2 for one in properties):
        row = np.dtype([(name, order + kind) for name, kind in properties])
        table = np.frombuffer(data, row, min(count, (len(data) - place) // max(row.itemsize, 1)), place)
        return {name: table[name] for name, _ in properties}, place + table.nbytes
    rows = list[list[tuple]]()
    with suppress(struct.error):  # the data end
        while len(rows) < count:
            found = []
            for _, *kinds in properties:
                numbers: tuple = (1,)
                for kind in kinds:
                    layout = f"{order}{int(numbers[0])}{kind}"
                    numbers, place = struct.unpack_from(layout, data, place), place + struct.calcsize(layout)
                found.append(numbers)
            rows.append(found)
    return {name: [row[i] for row in rows] for i, (name, *_) in enumerate(properties)}, place
