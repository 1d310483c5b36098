"""PLY files of any order of bytes, with polygons of various numbers of corners: trimesh and meshio want one number."""

import re
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdvol.errors import MeshError
from pdvol.meshing.polygons import cut_faces, cut_polygons

KINDS = {
    "char": "b",
    "int8": "b",
    "uchar": "B",
    "uint8": "B",
    "short": "h",
    "int16": "h",
    "ushort": "H",
    "uint16": "H",
    "int": "i",
    "int32": "i",
    "uint": "I",
    "uint32": "I",
    "float": "f",
    "float32": "f",
    "double": "d",
    "float64": "d",
}
"""Letters of `struct` and numpy for PLY's types of numbers."""
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}

Property = tuple[str, ...]
"""A name and the kind of its number; where it is a list, that of the list's length comes between."""


def read_ply(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles, polygons cut. Whatever comes after the promised data is left out.

    Raises
    ------
    MeshError
        It holds less than its header promises.
    """
    data = path.read_bytes()
    end = data.index(b"end_header") + len(b"end_header")
    order, elements = "", list[tuple[str, int, list[Property]]]()
    for word, *rest in filter(None, map(str.split, data[:end].decode("latin-1").splitlines())):
        if word == "format":
            order = ORDERS.get(rest[0], "")
        elif word == "element":
            elements.append((rest[0], int(rest[1]), []))
        elif word == "property":
            kinds = [KINDS[kind] if order else "d" for kind in rest[rest[0] == "list" : -1]]
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
            what = {"vertex": "vertices", "face": "faces"}.get(name, name)
            lack = f"it promises {count:,} {what} and holds {held:,}"
            raise MeshError(f"{path}: truncated, {lack}; export the mesh again")
    points = np.column_stack([np.ravel(found["vertex"][axis]) for axis in "xyz"]).astype(float)
    columns = found.get("face", {})
    faces = columns.get("vertex_indices", columns.get("vertex_index", []))
    if isinstance(faces, np.ndarray):
        return points, cut_polygons(points, faces).reshape(-1, 3)
    return points, cut_faces(points, [[int(corner) for corner in face] for face in faces])


def _columns(
    data: bytes, place: int, order: str, count: int, properties: Sequence[Property]
) -> tuple[dict[str, np.ndarray | list[tuple]], int]:
    """The rows of an element as columns by name, as many as there are, and the place behind them: arrays where all rows
    have as many numbers as the first.
    """
    rows, at, lengths = list[list[tuple]](), place, list[int]()
    while len(rows) < count:
        row = []
        try:
            for _, *kinds in properties:
                numbers: tuple = (1,)
                for kind in kinds:
                    layout = f"{order}{int(numbers[0])}{kind}"
                    numbers, at = struct.unpack_from(layout, data, at), at + struct.calcsize(layout)
                row.append(numbers)
        except struct.error:
            break
        rows.append(row)
        if len(rows) == 1:
            lengths = [len(numbers) for numbers in row]
            fields = [
                (f"{i}{'' if k + 1 == len(kinds) else 'n'}", order + kind, (n,) if k + 1 == len(kinds) else ())
                for i, ((_, *kinds), n) in enumerate(zip(properties, lengths, strict=True))
                for k, kind in enumerate(kinds)
            ]
            if len(data) - place >= count * np.dtype(fields).itemsize:
                table = np.frombuffer(data, np.dtype(fields), count, place)
                lists = [i for i, (_, *kinds) in enumerate(properties) if len(kinds) == 2]
                if all((table[f"{i}n"] == lengths[i]).all() for i in lists):
                    return {name: table[f"{i}"] for i, (name, *_) in enumerate(properties)}, place + table.nbytes
    return {name: [row[i] for row in rows] for i, (name, *_) in enumerate(properties)}, at
