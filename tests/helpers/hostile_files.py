"""Mesh files that something is wrong with, and what is to be said of each."""

from itertools import product
from pathlib import Path

import meshio
import numpy as np
import trimesh

from pdvol.meshes import ball, box
from pdvol.meshing.readers import SURFACES
from shapes import box as grid

CUBE, BALL = box(), ball(1.0, 2)
POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
SHELL = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
TETS = np.array([[0, 1, 2, 3], [1, 4, 2, 3]])
CELLS = grid(3, 2)
LABEL = {".msh": "gmsh:physical", ".mesh": "medit:ref", ".vtk": "material", ".vtu": "material", ".xdmf": "region"}


def write_cells(path: Path, points, cells: tuple[str, np.ndarray], labels=None) -> Path:
    """A mesh file of one kind of cells, with labels where they are given."""
    data = {} if labels is None else {LABEL[path.suffix]: [np.asarray(labels, dtype=np.int32)]}
    if path.suffix == ".msh" and labels is not None:
        data["gmsh:geometrical"] = data["gmsh:physical"]
    more = {"file_format": "gmsh22"} if path.suffix == ".msh" else {}
    meshio.Mesh(points, [cells], cell_data=data).write(path, **more)
    return path


def sound_file(folder: Path, suffix: str) -> Path:
    """A tetrahedron's surface, or two tetrahedra with regions 3 and 8."""
    if suffix in SURFACES:
        return write_cells(folder / f"a{suffix}", POINTS[:4], ("triangle", SHELL))
    return write_cells(folder / f"a{suffix}", POINTS, ("tetra", TETS), [3, 8])


def obj(points, faces) -> bytes:
    lines = ["v " + " ".join(repr(float(x)) for x in point) for point in points]
    return "\n".join([*lines, *("f " + " ".join(str(i + 1) for i in face) for face in faces), ""]).encode()


def off(points, faces) -> bytes:
    lines = [f"OFF\n{len(points)} {len(faces)} 0", *(" ".join(repr(float(x)) for x in point) for point in points)]
    return "\n".join([*lines, *(f"{len(face)} " + " ".join(map(str, face)) for face in faces), ""]).encode()


def stl(surface) -> bytes:
    corners = surface.vertices[surface.triangles].astype("<f4")
    rows = (bytes(12) + corner.tobytes() + bytes(2) for corner in corners)
    return bytes(80) + len(corners).to_bytes(4, "little") + b"".join(rows)


def mesh(points, cells) -> bytes:
    """Tetrahedra as a Medit file."""
    rows = [" ".join(repr(float(x)) for x in point) + " 0" for point in points]
    return "\n".join(
        ["MeshVersionFormatted 2", "Dimension 3", "Vertices", str(len(rows)), *rows, "Tetrahedra", str(len(cells))]
        + [" ".join(str(i + 1) for i in cell) + " 0" for cell in cells]
        + ["End", ""]
    ).encode()


def vtu(counts=(5, 2)) -> bytes:
    points = "0 0 0 1 0 0 0 1 0 0 0 1 1 1 1"
    array = '<DataArray type="{}" Name="{}" {} format="ascii">{}</DataArray>'.format
    return (
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">'
        f'<UnstructuredGrid><Piece NumberOfPoints="{counts[0]}" NumberOfCells="{counts[1]}"><Points>'
        + array("Float64", "Points", 'NumberOfComponents="3"', points)
        + "</Points><Cells>"
        + array("Int64", "connectivity", "", "0 1 2 3 1 4 2 3")
        + array("Int64", "offsets", "", "4 8")
        + array("UInt8", "types", "", "10 10")
        + "</Cells></Piece></UnstructuredGrid></VTKFile>\n"
    ).encode()


def together(*parts) -> tuple[np.ndarray, np.ndarray]:
    """Points and cells of several (points, cells) in one."""
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    return np.vstack([points for points, _ in parts]), np.vstack(
        [np.asarray(cells) + start for (_, cells), start in zip(parts, starts, strict=False)]
    )


def shifted(surface, by, turned=False, size=1.0) -> tuple[np.ndarray, np.ndarray]:
    return size * surface.vertices + np.asarray(by), surface.triangles[:, ::-1] if turned else surface.triangles


def tets(by=0.0, size=1.0) -> tuple[np.ndarray, np.ndarray]:
    return CELLS.points * size + np.asarray(by), CELLS.cells


def joined(*parts) -> tuple[np.ndarray, np.ndarray]:
    """`together`, with vertices at one place made one."""
    points, cells = together(*parts)
    points, index = np.unique(points, axis=0, return_inverse=True)
    return points, index.ravel()[cells]


UNWELDED = CUBE.vertices[CUBE.triangles].reshape(-1, 3), np.arange(3 * len(CUBE.triangles)).reshape(-1, 3)
NEARLY = UNWELDED[0] * (1 + 1e-11 * np.arange(len(UNWELDED[0]))[:, None]), UNWELDED[1]
DOUBLED = CUBE.vertices, np.vstack([CUBE.triangles, CUBE.triangles])
TWICE = CUBE.vertices, np.vstack([CUBE.triangles, CUBE.triangles[:, ::-1]])
OPEN = BALL.vertices, BALL.triangles[4:]
HALF_TURNED = CUBE.vertices, np.vstack([CUBE.triangles[:5, ::-1], CUBE.triangles[5:]])
WALL = np.vstack([CUBE.vertices, [[0.0, 0.0, 0.0]]]), np.vstack([CUBE.triangles, [[*CUBE.triangles[0, :2], 8]]])
PINCHED = joined(shifted(CUBE, 0.0), shifted(CUBE, 1.0))
SHARED_EDGE = joined(shifted(CUBE, 0.0), shifted(CUBE, (1.0, 1.0, 0.0)))
FLAT = (
    np.vstack([CUBE.vertices, CUBE.vertices[CUBE.triangles[0, :2]].mean(axis=0)]),
    np.vstack([CUBE.triangles[0, [0, 1]].tolist() + [8], CUBE.triangles]),
)
"""A cube, and a triangle without area on one of its edges."""
COARSE = ball(1.0, 1)
CROSSING = together(shifted(COARSE, 0.0), shifted(COARSE, (1.1, 0.2, 0.1)))
CORNERS = np.array(list(product((0.0, 1.0), repeat=3)))
QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
SPLIT = [[0, 8, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1, 8], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
"""The faces of a cube; two of them have a corner, number 8, in the middle of an edge."""

WRONG: dict[str, tuple[bytes, str]] = {
    # Files that are something else than they seem.
    "utf16.obj": (obj(*shifted(CUBE, 0.0)).decode().encode("utf-16"), "UTF-16"),
    "utf16_without_mark.off": (off(*shifted(CUBE, 0.0)).decode().encode("utf-16-le"), "UTF-16"),
    "truncated.stl": (stl(BALL)[:2000], "promises 320 triangles and holds 38 and"),
    "negative.off": (b"OFF\n-8 12 0\n", "negative count"),
    "negative.ply": (b"ply\nformat ascii 1.0\nelement vertex -8\nend_header\n", "negative count"),
    "negative.vtk": (
        b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS -8 double\n",
        "negative",
    ),
    "negative.mesh": (b"MeshVersionFormatted 2\nDimension 3\nVertices\n-8\n", "negative count"),
    "negative.vtu": (vtu((-5, 2)), "negative count"),
    "stl.obj": (stl(CUBE), "an STL file under the name of an OBJ one; rename it to stl.stl"),
    "text.obj": (b"solid a\nfacet normal 0 0 1\n", "an STL file under the name of an OBJ one"),
    "gmsh1.msh": (b"$NOD\n4\n1 0 0 0\n$ENDNOD\n", "unreadable or truncated"),
    "binary.off": (b"OFF BINARY\n" + bytes(200), "binary OFF"),
    "vtu.vtk": (vtu(), "a VTU file under the name of a legacy VTK one; rename it to vtu.vtu"),
    "fewer_points.vtu": (vtu((4, 2)), "counts of points and cells do not fit"),
    "more_cells.vtu": (vtu((5, 3)), "counts of points and cells do not fit"),
    "alone.node": (b"4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n", "no alone.ele beside it"),
    # Meshes of tetrahedra whose boundary is no body's surface.
    "overlapping.mesh": (mesh(*together(tets(), tets(0.37))), "boundary: triangles .* cross"),
    "nested.mesh": (
        mesh(*together(tets(), tets((0.3, 0.3, 0.3), 0.3))),
        "inside another one, so that two bodies overlap",
    ),
    "touching.mesh": (mesh(*together(tets(), tets((1.0, 0.2, 0.3)))), "boundary: .*(touches|cross)"),
    "unwelded.mesh": (
        mesh(CELLS.points[CELLS.cells].reshape(-1, 3), np.arange(4 * len(CELLS.cells)).reshape(-1, 4)),
        "weld: ",
    ),
    "edge.mesh": (mesh(grid(3, 2).points, CELLS.cells[[0, 47]]), "non-manifold|single vertices|touches"),
    "partly_inverted.mesh": (
        mesh(CELLS.points, np.vstack([CELLS.cells[:1, [1, 0, 2, 3]], CELLS.cells[1:]])),
        "inverted",
    ),
    # Surfaces that are none.
    "open.obj": (obj(*OPEN), "open along"),
    "doubled.obj": (obj(*DOUBLED), "repeat others"),
    "twice.obj": (obj(*TWICE), "repeat others"),
    "nearly_welded.obj": (obj(*NEARLY), "weld: 36 vertices coincide within 1e-08"),
    "half_turned.obj": (obj(*HALF_TURNED), "disagree on what is outside"),
    "wall.obj": (obj(*WALL), "non-manifold"),
    "pinched.obj": (obj(*PINCHED), "single vertices"),
    "shared_edge.obj": (obj(*SHARED_EDGE), "more than two triangles"),
    "flat_triangle.obj": (obj(*FLAT), "have no area"),
    "crossing.obj": (obj(*CROSSING), "cross"),
    "inside.obj": (obj(*together(shifted(BALL, 0.0), shifted(BALL, 0.0, size=0.5))), "inside another one"),
    "flat_and_unused.off": (
        off(
            [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], *np.random.default_rng(1).random((5000, 3))],
            [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
        ),
        "encloses no volume",
    ),
    # Sizes and places without precision.
    "tiny.obj": (obj(*shifted(CUBE, 0.0, size=1e-9)), "1.73e-09 m across; lengths are metres"),
    "far.obj": (obj(*shifted(CUBE, 1e8)), "from the origin .* lose their precision"),
    "needle.obj": (obj(CUBE.vertices * (1.0, 1e-7, 1e-7), CUBE.triangles), "times as long as it is thin"),
}

SOUND: dict[str, tuple[bytes, str]] = {
    "bom.obj": (b"\xef\xbb\xbf" + obj(*shifted(CUBE, 0.0)), ""),
    "collinear.obj": (obj([*CORNERS, [0, 0, 0.5]], SPLIT), ""),
    "collinear.off": (off([*CORNERS, [0, 0, 0.5]], SPLIT), ""),
    "longer.stl": (stl(BALL) + b"\r\n", "2 bytes after its 320 triangles are left out"),
    "unwelded.obj": (obj(*UNWELDED), "28 vertices repeat others exactly and are welded"),
    "inward.obj": (obj(*shifted(CUBE, 0.0, turned=True)), "all triangles face inward; they are turned"),
    "unused.obj": (
        obj(np.vstack([CUBE.vertices, np.ones((3, 3))]), CUBE.triangles),
        "3 of 11 vertices belong to no triangle",
    ),
    "cavity.obj": (obj(*together(shifted(BALL, 0.0), shifted(BALL, 0.0, True, 0.5))), ""),
    "inverted.mesh": (mesh(CELLS.points, CELLS.cells[:, [1, 0, 2, 3]]), "all cells are inverted; they are turned"),
    "sliver.mesh": (
        mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.3, 0.3, -1e-3]], [[0, 1, 2, 3], [0, 2, 1, 4]]),
        "1 cells are slivers .*: 1",
    ),
    "pair.node": (b"# points\n5 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n", ""),
    "quadratic.vtu": (b"", "1 quadratic cells are read by their corners"),
}

MENDED = "open doubled twice nearly_welded half_turned pinched shared_edge flat_triangle crossing".split()
MENDED = (*(f"{name}.obj" for name in MENDED), "unwelded.mesh", "partly_inverted.mesh")
"""Files of `WRONG` that `pdvol repair` turns into bodies."""


def write(folder: Path) -> None:
    """All files, into a folder."""
    for name, (data, _) in {**WRONG, **SOUND}.items():
        (folder / name).write_bytes(data)
    (folder / "pair.ele").write_bytes(b"2 4 1\n1 1 2 3 4 7\n2 2 5 3 4 8\n")
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    middles = [(corners[i] + corners[j]) / 2 for i, j in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))]
    meshio.Mesh(np.vstack([corners, middles]), [("tetra10", np.arange(10)[None])]).write(folder / "quadratic.vtu")


def ply(**more) -> bytes:
    data = trimesh.Trimesh(CUBE.vertices, CUBE.triangles, process=False).export(file_type="ply", **more)
    return data if isinstance(data, bytes) else data.encode()


def stl_text() -> str:
    return trimesh.Trimesh(CUBE.vertices, CUBE.triangles, process=False).export(file_type="stl_ascii")
