"""Surface files with more than their data are read, truncated ones are refused."""

import struct

import numpy as np
import pytest
import trimesh

from hostile_files import CUBE, obj, off, ply, stl, stl_text
from pdvol.errors import MeshError
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.meshes import Surface
from pdvol.meshing.readers import read_shape, read_with_notes
from pdvol.meshing.validate import check_surface


def coloured() -> bytes:
    found = trimesh.Trimesh(CUBE.vertices, CUBE.triangles, process=False)
    found.visual.face_colors = [255, 0, 0, 255]
    return found.export(file_type="ply")


def with_comments(vertex: str, face: str) -> bytes:
    """The lines of a cube in an OBJ file, with something at their ends."""
    lines = obj(CUBE.vertices, CUBE.triangles).decode().splitlines()
    return "\n".join(line + {"v": vertex, "f": face}[line[0]] for line in lines).encode()


READ = {
    "newline.ply": ply() + b"\n",
    "zeros.ply": ply() + bytes(4096),
    "ascii.ply": ply(encoding="ascii") + b"\n\nand more\n",
    "colours.ply": coloured() + b"\n",
    "newline.stl": stl(CUBE) + b"\r\n",
    "one_more.stl": stl(CUBE) + stl(CUBE)[84:134],
    "solid.stl": b"solid model".ljust(80) + stl(CUBE)[80:] + b"\0",
    "both.stl": stl_text().upper().replace(".", ",").replace("\n", "\r\n").encode(),
    "between.stl": stl_text().replace(" 0", ", 0").replace("vertex,", "vertex").encode(),
    "returns.stl": stl_text().replace("\n", "\r").encode(),
    "semicolons.stl": stl_text().replace("\n", ";\n").encode(),
    "one_line.stl": stl_text().replace("\n", " ").encode(),
    "more.stl": stl_text().encode() + b"\n; made by a program\n",
    "face.obj": with_comments("", " # one"),
    "tight.obj": with_comments("#a b", "#1/2 x"),
    "tab.obj": with_comments(" # of 8", "\t# 1 2 3"),
    "wordless.off": off(CUBE.vertices, CUBE.triangles).removeprefix(b"OFF\n"),
    "rest.off": off(CUBE.vertices, CUBE.triangles) + b"3 0 0 0\n# more\n",
}


@pytest.mark.parametrize("name", READ)
def test_surfaces_with_more_than_their_data(tmp_path, name):
    (tmp_path / name).write_bytes(READ[name])
    surface, notes = read_with_notes(tmp_path / name)
    assert isinstance(surface, Surface) and len(surface.vertices) == 8 and len(surface.triangles) == 12
    check_surface(surface)
    np.testing.assert_allclose(np.sort(surface.vertices, axis=0), np.sort(CUBE.vertices, axis=0))
    binary = name.endswith(".stl") and READ[name].startswith((bytes(9), b"solid model"))
    assert notes == ([f"{len(READ[name]) - 684:,} bytes after its 12 triangles are left out"] if binary else [])


@pytest.mark.parametrize(
    ("name", "data", "cause"),
    [
        ("cut.ply", ply()[:-20], "promises 12 faces and holds 10"),
        ("cut_ascii.ply", ply(encoding="ascii")[:-20], "promises 12 faces and holds"),
        ("cut.stl", stl(CUBE)[:-30], "promises 12 triangles and holds 11 and 20 bytes"),
        ("cut_ascii.stl", stl_text()[:-60].encode(), "facets begin"),
        ("thousands.stl", stl_text().replace("0.5", "1,000.5").encode(), "could not convert"),
    ],
)
def test_surfaces_with_less_than_their_data(tmp_path, name, data, cause):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(MeshError, match=cause):
        read_shape(tmp_path / name)


def prism_ply(form: str) -> bytes:
    """A prism over a hexagon: faces of six, three and four corners between properties of other kinds, an element before
    them, and bytes behind.
    """
    order = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}[form]
    turns = np.arange(12) * np.pi / 3
    sides = [(k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6) for k in range(1, 6)]
    faces = [range(5, -1, -1), range(6, 12), (0, 1, 7), (0, 7, 6), *sides]
    rows = [[("h", 7), ("B", 2), ("f", 0.5), ("f", 1.5)]]
    rows += [[("d", np.cos(turns[k])), ("f", np.sin(turns[k])), ("f", float(k > 5)), ("B", 3)] for k in range(12)]
    for group, face in enumerate(faces):
        row = [("i", group), ("B", len(face)), *(("I", corner) for corner in face)]
        rows.append([*row, ("B", 2 * len(face)), *[("f", 0.25)] * (2 * len(face))])
    head = f"""ply\nformat {form} 1.0\ncomment of a test
element camera 1\nproperty short kind\nproperty list uchar float lens
element vertex 12\nproperty double x\nproperty float y\nproperty float32 z\nproperty uint8 red
element face {len(faces)}\nproperty int group\nproperty list uchar uint vertex_indices
property list uint8 float texcoord\nend_header\n""".encode()
    if form == "ascii":
        return head + "\n".join(" ".join(f"{v:.17g}" for _, v in row) for row in rows).encode() + b"\n\nmore 1\n"
    return head + b"".join(struct.pack(order + kind, v) for row in rows for kind, v in row) + b"\nmore"


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian", "ascii"])
def test_ply_files_with_faces_of_various_corners(tmp_path, form):
    (tmp_path / "prism.ply").write_bytes(prism_ply(form))
    surface, notes = read_with_notes(tmp_path / "prism.ply")
    assert len(surface.vertices) == 12 and len(surface.triangles) == 2 * 4 + 2 + 5 * 2
    check_surface(surface)
    assert enclosed_volume(surface.vertices, surface.triangles) == pytest.approx(1.5 * np.sqrt(3.0), rel=1e-6)
    assert notes == ["labels of faces left out, for a surface has no regions: 1 (group)"]
    two = (stl_text().replace("solid", f"solid {name}") for name in ("left", "right part"))
    (tmp_path / "two.stl").write_text("".join(two))
    assert read_with_notes(tmp_path / "two.stl")[1][-1].endswith("for a surface has no regions: 2 (left, right part)")
    (tmp_path / "strips.ply").write_bytes(ply(encoding="ascii").replace(b"element face", b"element tristrips"))
    with pytest.raises(MeshError, match="its triangles are strips"):
        read_shape(tmp_path / "strips.ply")
    (tmp_path / "cut.ply").write_bytes(prism_ply(form)[:-100])
    with pytest.raises(MeshError, match=r"promises 9 faces and holds [678]; export the mesh again"):
        read_with_notes(tmp_path / "cut.ply")
