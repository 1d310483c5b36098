"""Surfaces that are drawn: polygons, seams and textures of OBJ files, and what is refused in one line."""

import numpy as np
import pytest
import trimesh

from pdvol import meshes
from pdvol.errors import InputError, MeshError
from pdvol.meshing.render_files import read_render_surface, read_texture

# A house front: a square of two seams' worth of places, a gable, and a corner without a place.
HOUSE = """mtllib house.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0.5 1.5 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl wall
f 1/1/1 2/2/1 3/3/1 4/4/1
vt 0.25 0.75
usemtl roof
f -2/-2 -3/3 -1/-1
"""


def test_polygons_seams_and_relative_numbers(tmp_path):
    (tmp_path / "house.obj").write_text(HOUSE)
    surface, picture, _ = read_render_surface(tmp_path / "house.obj", "x")
    assert picture == [] and surface.counts.tolist() == [4, 3]
    assert surface.corners.tolist() == [0, 1, 2, 3, 3, 2, 4]
    assert surface.uv_corners.tolist() == [0, 1, 2, 3, 3, 2, 4]
    np.testing.assert_array_equal(surface.uvs[-1], [0.25, 0.75])
    assert surface.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 4]]
    (tmp_path / "a.obj").write_text(TRIANGLE + "vt 0.5 0.5\nf 1/1 2 3/1\n")  # a corner without a place gets one
    surface, *_ = read_render_surface(tmp_path / "a.obj", "x")
    assert surface.uv_corners.tolist() == [0, 1, 0] and surface.uvs.tolist() == [[0.5, 0.5], [0.0, 0.0]]


def test_the_texture_that_materials_name(tmp_path):
    (tmp_path / "house.obj").write_text(HOUSE)
    (tmp_path / "my wall.png").write_bytes(b"\x89PNG")
    material = "newmtl wall\nmap_Kd my wall.png\nnewmtl unused\nmap_Kd b.png\n"
    (tmp_path / "house.mtl").write_text(material)
    assert read_render_surface(tmp_path / "house.obj", "x")[1] == [str(tmp_path / "my wall.png")]
    (tmp_path / "b.png").write_bytes(b"\x89PNG")
    (tmp_path / "house.mtl").write_text(material + "newmtl roof\nmap_Kd -s 2 2 1 b.png\n")
    assert read_render_surface(tmp_path / "house.obj", "x")[1] == [
        str(tmp_path / "my wall.png"),
        str(tmp_path / "b.png"),
    ]
    surface, pictures, _ = read_render_surface(tmp_path / "house.obj", "x", "roof")
    assert pictures == [str(tmp_path / "b.png")] and surface.counts.tolist() == [3]
    assert surface.vertices.tolist() == [[1, 1, 0], [0, 1, 0], [0.5, 1.5, 0]] and surface.corners.tolist() == [1, 0, 2]
    assert surface.uvs[surface.uv_corners].tolist() == [[0, 1], [1, 1], [0.25, 0.75]]
    with pytest.raises(MeshError, match="no face has the material 'door'; its materials are wall, roof"):
        read_render_surface(tmp_path / "house.obj", "x", "door")
    with pytest.raises(InputError, match="x: material='roof' chooses faces of an OBJ file"):
        read_render_surface(surface, "x", "roof")


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
ONE = "mtllib {}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
BESIDE = "; put what is missing beside the file, or give RenderMesh(texture=...)"


@pytest.mark.parametrize(
    ("library", "material", "picture", "lost"),
    [
        ("a.mtl", "newmtl a\nmap_Kd red.png\n", "red.png", ""),
        ("a.mtl", None, "", f"files of materials that are missing: 1 (a.mtl){BESIDE}"),
        ("a.mtl", "newmtl a\nmap_Kd gone.png\n", "", f"textures that are missing: 1 (gone.png){BESIDE}"),
        ("a.mtl", "newmtl a\nmap_Kd C:\\art\\RED.png\n", "red.png", ""),
        ("a.mtl", "newmtl a\nmap_Kd \\\\server\\art\\red.png\n", "red.png", ""),
        ("a.mtl", "newmtl a\nmap_Kd /home/somebody/my wall.png\n", "my wall.png", ""),
        ("a.mtl", "newmtl a\nmap_Kd -o 0 0 0 -s 2 2 1 -clamp on my wall.png\n", "my wall.png", ""),
        ("a.mtl", "newmtl a\nmap_Kd -bm 1.0 D:/b c/my wall.png\n", "my wall.png", ""),
        ("C:\\exports\\a.mtl", "newmtl a\nmap_Kd red.png\n", "red.png", ""),
        ("a.mtl", "newmtl b\nmap_Kd red.png\n", "", f"materials that no file has: 1 (a){BESIDE}"),
        ("a.mtl", "newmtl a\nmap_Kd\n", "", f"textures that are missing: 1 (map_Kd without a name){BESIDE}"),
        (
            "a.mtl",
            "newmtl a\nmap_Kd red.png\nmap_Bump n.png\nmap_d red.png\nnewmtl b\nmap_Ks s.png\n",
            "red.png",
            "textures of other kinds left out: 2 (map_Bump n.png, map_d red.png)",
        ),
    ],
)
def test_textures_are_found_beside_the_file_and_named_where_they_are_lost(tmp_path, library, material, picture, lost):
    for name in ("red.png", "my wall.png"):
        (tmp_path / name).write_bytes(b"\x89PNG")
    (tmp_path / "s.obj").write_text(ONE.format(library))
    if material is not None:
        (tmp_path / "a.mtl").write_text(material)
    _, found, lines = read_render_surface(tmp_path / "s.obj", "x")
    assert found == ([str(tmp_path / picture)] if picture else [])
    assert lines == ([f"{tmp_path / 's.obj'}: {lost}"] if lost else [])


def test_what_a_ply_file_has_of_textures_is_named(tmp_path):
    head = "ply\nformat ascii 1.0\ncomment TextureFile skin.png\nelement vertex 3\n"
    head += "".join(f"property float {name}\n" for name in "xyzst") + "property uchar red\n"
    rows = "0 0 0 0 0 9\n1 0 0 0 0 9\n0 1 0 0 0 9\n3 0 1 2\n"
    (tmp_path / "s.ply").write_text(f"{head}element face 1\nproperty list uchar int vertex_indices\nend_header\n{rows}")
    line = f"{tmp_path / 's.ply'}: of a PLY file not read, export OBJ: 3 (skin.png, texture coordinates, colours)"
    assert read_render_surface(tmp_path / "s.ply", "x")[1:] == ([], [line])


def test_other_files_have_no_places(tmp_path):
    ball = trimesh.creation.icosphere(2)
    ball.export(tmp_path / "ball.ply")
    surface, *_ = read_render_surface(tmp_path / "ball.ply", "x")
    assert len(surface.vertices) == len(ball.vertices) and len(surface.uvs) == 0
    np.testing.assert_array_equal(surface.triangles, ball.faces)


@pytest.mark.parametrize(
    ("read", "name", "text", "said"),
    [
        (read_render_surface, "a.obj", TRIANGLE + "f 1 2 4\n", "faces use vertices that there are not"),
        (read_render_surface, "a.obj", TRIANGLE + "vt 0 0\nf 1/1 2/1 3/2\n", "texture coordinate 2, and there are 1"),
        (read_render_surface, "a.obj", TRIANGLE + "f 1/a 2/b 3/c\n", "unreadable or truncated"),
        (read_render_surface, "a.obj", "v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "not finite numbers"),
        (read_render_surface, "a.obj", "v 0 0 0\n", "a render mesh needs vertices"),
        (read_render_surface, "a.obj", "", "the file is empty"),
        (read_render_surface, "a.obj", None, "there is no such file"),
        (read_render_surface, "a.msh", None, "a render mesh is a surface; give one of .obj"),
        (read_texture, "a.png", None, "x: the texture .* cannot be read"),
        (read_texture, "a.tga", None, "none of .png, .jpg, .jpeg"),
        (read_texture, "a.png", "no picture", "is no .png picture"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, read, name, text, said):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=said) as caught:
        read(tmp_path / name, "x")
    assert "\n" not in str(caught.value) and str(tmp_path / name) in str(caught.value)


def test_the_donut_of_the_demo():
    surface = meshes.donut_render(0.3, 0.13, 64, 32)
    assert trimesh.Trimesh(surface.vertices, surface.triangles, process=False).is_watertight
    x, y, z = surface.vertices[surface.corners].T
    u, v = 2 * np.pi * surface.uvs[surface.uv_corners].T
    np.testing.assert_allclose(np.cos(np.arctan2(z, x) - u), 1.0)
    np.testing.assert_allclose(np.cos(np.arctan2(y, np.hypot(x, z) - 0.3) - v), 1.0)
    tube = np.hypot(y, np.hypot(x, z) - 0.3)
    assert tube.min() == pytest.approx(0.13, rel=1e-6) and tube.max() == pytest.approx(0.13 * 1.06, rel=1e-3)
    assert y[tube > 0.135].min() > -0.05 and abs(tube[y < -0.06] - 0.13).max() < 1e-4
    picture = meshes.donut_texture(256, 128)
    pink = (picture[..., 2].astype(int) - picture[..., 1] > 20).mean(axis=1)
    assert pink[90] > 0.9 and pink[32] == 0.0, "rows begin at the top, where v is 1"
