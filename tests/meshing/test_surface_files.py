"""Surface files with more than their data are read, truncated ones are refused."""

import numpy as np
import pytest
import trimesh

from hostile_files import CUBE, obj, off, ply, stl, stl_text
from pdvol.errors import MeshError
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
        ("cut.ply", ply()[:-20], "unexpected length"),
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
