"""Triangles from files of surfaces, and from the blocks of meshio; polygons are cut.

PLY is read here, of any order of bytes: trimesh and meshio want equally many corners of all polygons.
"""

import re
import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from pdvol.errors import MeshError
from pdvol.meshes import Surface
from pdvol.meshing.file_kinds import bytes_after_stl
from pdvol.meshing.losses import face_labels, lost_labels
from pdvol.meshing.polygons import cut_faces, cut_polygons

if TYPE_CHECKING:
    import meshio

SURFACES = (".obj", ".ply", ".off", ".stl")
CORNERS = {"tetra": 4, "triangle": 3, "quad": 4}
"""Cells that are read, by the beginnings of their names, and how many of their nodes are corners: the first ones."""
Result = TypeVar("Result")
_NAMES = "char int8 uchar uint8 short int16 ushort uint16 int int32 uint uint32 float float32 double float64"
LETTERS = dict(zip(_NAMES.split(), "bbBBhhHHiiIIffdd", strict=True))
"""Letters of `struct` and numpy for PLY's types of numbers."""
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def read_surface(path: Path) -> tuple[Surface, list[str]]:
    """The triangles of a file of `SURFACES`, in a child process; notes say which bytes and labels are left out. It
    raises MeshError where it is unreadable, truncated, or holds no triangles.
    """
    suffix = path.suffix.lower()
    points, triangles = first_that_reads(path, {".obj": read_obj, ".off": _off, ".stl": _stl, ".ply": read_ply}[suffix])
    if len(triangles) == 0:
        raise MeshError(f"{path}: holds no triangles; export a triangle surface")
    more = bytes_after_stl(path) if suffix == ".stl" else 0
    notes = [f"{more:,} bytes after its {len(triangles):,} triangles are left out"] if more else []
    surface = Surface(np.ascontiguousarray(points, dtype=np.float64), indices(path, triangles))
    return surface, notes + lost_labels(face_labels(path))


def first_that_reads(path: Path, *readers: Callable[[Path], Result]) -> Result:
    """The result of the first reader that succeeds; if all fail, a MeshError states the first reason."""
    reasons = []
    for reader in readers:
        try:
            return reader(path)
        except MemoryError:
            raise
        # The libraries raise whatever they like, and meshio calls sys.exit.
        except (Exception, SystemExit) as error:
            if isinstance(error, MeshError) and str(error).startswith(str(path)):  # what is wrong is known
                raise
            reasons.append(" ".join(str(error).split()) if not isinstance(error, SystemExit) else "")
    reason = next((r for r in reasons if r), "its contents do not fit its extension")
    raise MeshError(f"{path}: unreadable or truncated ({reason[:160]}); export the mesh again")


def indices(path: Path, cells: np.ndarray) -> np.ndarray:
    """The cells as int32, after a check that all indices fit: numpy would wrap larger ones silently."""
    cells = np.asarray(cells)
    if cells.size and (cells.min() < -(2**31) or cells.max() >= 2**31):
        raise MeshError(f"{path}: cells use vertices beyond number {2**31 - 1:,}; export the mesh again")
    return np.ascontiguousarray(cells, dtype=np.int32)


@dataclass
class ObjText:
    """The lines of an OBJ file that describe a surface: its `points` (n, 3), and the corners of each face, numbered
    from 0. As the file has them: the number of each corner's `vt` line, with how many of these came before the face;
    the words of each `vt` line (`uvs`); files of materials; and the material of each face, "" where it has none.
    """

    points: list[tuple[float, float, float]] = field(default_factory=list)
    faces: list[list[int]] = field(default_factory=list)
    textures: list[tuple[list[str], int]] = field(default_factory=list)
    uvs: list[list[str]] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    materials: list[str] = field(default_factory=list)


def parse_obj(path: Path) -> ObjText:
    """The lines of an OBJ file; ValueError or IndexError where points or faces are none."""
    found, material = ObjText(), ""
    points, faces = found.points, found.faces
    for line in path.read_text(encoding="utf-8-sig", errors="replace").replace("\\\n", " ").splitlines():
        word, *rest = line.split() or [""]
        if word in ("v", "f", "vt"):
            rest = line.partition("#")[0].split()[1:]
        if word == "v":
            x, y, z = rest[:3]
            points.append((float(x), float(y), float(z)))
        elif word == "f":
            parts = [corner.split("/") for corner in rest]
            corners = [int(part[0]) for part in parts]
            if len(corners) < 3 or 0 in corners:
                raise ValueError(f"face {line.strip()!r} has no three corners")
            faces.append([c - 1 if c > 0 else len(points) + c for c in corners])
            found.materials.append(material)
            found.textures.append(([part[1] if len(part) > 1 else "" for part in parts], len(found.uvs)))
        elif word == "vt":
            found.uvs.append(rest)
        elif word == "mtllib":
            found.libraries.append(line.split(None, 1)[1].strip() if rest else "")
        elif word == "usemtl":
            material = " ".join(rest)
    return found


def read_obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The `v` and `f` lines of an OBJ file, polygons cut, texture and normal indices left out."""
    found = parse_obj(path)
    places = np.array(found.points).reshape(-1, 3)
    return places, cut_faces(places, found.faces)


def _stl(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Every triangle brings its own corners: equal ones become one vertex."""
    data = path.read_bytes()
    if bytes_after_stl(path) is not None:
        row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
        corners = np.frombuffer(data, row, int.from_bytes(data[80:84], "little"), 84)["corners"].astype(np.float64)
    else:
        text = data.decode("utf-8-sig", "replace").lower()
        found = re.findall(r"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", text)
        facets, ends = len(re.findall(r"\bfacet\b", text)), len(re.findall(r"\bendfacet\b", text))
        if not len(found) == 3 * facets == 3 * ends:
            raise ValueError(f"{facets} facets begin, {ends} end, with {len(found)} corners")
        # A comma is the sign of decimals, or stands between two numbers.
        corners = np.array([[word.rstrip(",;").replace(",", ".") for word in row] for row in found], dtype=np.float64)
    points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return points, index.reshape(-1, 3)


def read_ply(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles, polygons cut. What follows the promised data is left out; MeshError if fewer."""
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


def _off(path: Path) -> tuple[np.ndarray, np.ndarray]:
    lines = (line.partition("#")[0].split() for line in path.read_text(errors="replace").splitlines())
    words = [line for line in lines if line]
    if not words[0][0].isdigit():  # a word such as OFF or COFF, which may be left out
        words[0] = words[0][1:]
    header = words.pop(0) or words.pop(0)
    n, m = int(header[0]), int(header[1])
    if len(words) < n + m:
        raise ValueError(f"{n} vertices and {m} faces promised, {len(words)} lines found")
    points = np.array([[float(x) for x in line[:3]] for line in words[:n]]).reshape(-1, 3)
    faces = [[int(c) for c in line[1 : int(line[0]) + 1]] for line in words[n : n + m]]
    if any(not 0 <= c < n for face in faces for c in face):
        raise IndexError(f"a face has an index beyond the {n} vertices")
    return points, cut_faces(points, faces)


def triangles_of(mesh: "meshio.Mesh") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles (k, 3), quadrilaterals and polygons cut; the index of the cell block of each, with its row there."""
    triangles, blocks, rows = [], [], []
    for b, block in enumerate(mesh.cells):
        data = np.asarray(block.data)
        if block.type not in ("triangle", "quad", "polygon") or data.ndim != 2 or len(data) == 0:
            continue
        cut = cut_polygons(np.asarray(mesh.points, dtype=np.float64), data)
        triangles.append(cut.swapaxes(0, 1).reshape(-1, 3))
        blocks.append(np.full(len(triangles[-1]), b))
        rows.append(np.tile(np.arange(len(data)), cut.shape[1]))
    if not triangles:
        return np.empty((0, 3), dtype=np.int64), np.empty(0, dtype=int), np.empty(0, dtype=int)
    return np.concatenate(triangles), np.concatenate(blocks), np.concatenate(rows)
