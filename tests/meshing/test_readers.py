"""Every kind of file is read, in one meaning; every kind of bad file gives one line and prints nothing."""

from collections import Counter
from pathlib import Path

import meshio
import numpy as np
import pytest

from hostile_files import POINTS, SHELL, TETS, sound_file, write_cells
from pdvol.errors import InputError, MeshError
from pdvol.meshes import Solid, Surface
from pdvol.meshing.readers import SURFACES, VOLUMES, read_shape, read_with_notes
from pdvol.meshing.validate import check_solid, check_surface

SHARED = Path(__file__).parents[2].parent / "shared"


@pytest.mark.parametrize("suffix", SURFACES + VOLUMES)
def test_each_kind_is_read_with_its_regions_and_without_its_byte_order_mark(tmp_path, suffix):
    path = sound_file(tmp_path, suffix)
    plain = read_shape(str(path))
    if suffix in SURFACES:
        assert isinstance(plain, Surface) and plain.vertices.shape == (4, 3), "STL corners are merged"
        check_surface(plain)
    else:
        assert isinstance(plain, Solid) and plain.vertices.shape == (5, 3) and plain.regions.tolist() == [3, 8]
        check_solid(plain)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    marked = read_shape(path)
    for name in ("vertices", "triangles" if suffix in SURFACES else "cells"):
        np.testing.assert_array_equal(getattr(marked, name), getattr(plain, name))
    if suffix == ".stl":
        meshio.Mesh(plain.vertices, [("triangle", plain.triangles)]).write(path, binary=True)
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
        assert len(read_shape(path).triangles) == len(plain.triangles)
    if suffix in VOLUMES and suffix != ".mesh":
        flat = read_shape(write_cells(tmp_path / f"b{suffix}", POINTS[:3], ("triangle", SHELL[:1, ::-1]), [4]))
        assert isinstance(flat, Solid) and flat.vertices.shape == (3, 2) and flat.regions.tolist() == [4]


def test_obj_with_seams_polygons_and_negative_indices(tmp_path):
    path = tmp_path / "quad.obj"
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0 1.0\nvt 0 0\nvt 1 0\nvn 0 0 1\n"
    path.write_text(f"{corners}f 1/1/1 2/2/1 3/1/1 4/2/1\nf -4//1 -2//1 -3//1\n")
    surface = read_shape(path)
    assert surface.vertices.shape == (4, 3)
    assert surface.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 2, 1]]


# ---- bad input


def refuse(path, error, match, capfd):
    with pytest.raises(error, match=match) as caught:
        read_shape(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    out = capfd.readouterr()
    assert out.out == "" and out.err == "", "libraries stay silent"


def test_missing_unknown_and_empty(tmp_path, capfd):
    refuse(tmp_path / "none.obj", InputError, "no such file", capfd)
    refuse(tmp_path / "shape.docx", InputError, "unknown kind", capfd)
    refuse(tmp_path, InputError, "unknown kind", capfd)
    (tmp_path / "zero.ply").touch()
    refuse(tmp_path / "zero.ply", MeshError, "empty", capfd)


@pytest.mark.parametrize("suffix", SURFACES + VOLUMES)
def test_garbage_and_truncated_files(tmp_path, suffix, capfd):
    path = sound_file(tmp_path, suffix)
    whole = path.read_bytes()
    capfd.readouterr()
    shares = (0.55,) if suffix in (".vtk", ".vtu") else (0.06, 0.2, 0.55)  # VTK begins a process of its own
    # The writers put the cells last, but for VTU, whose closing tags are what goes missing.
    for data in (np.random.default_rng(1).bytes(2000), *(whole[: int(k * len(whole))] for k in shares)):
        path.write_bytes(data)
        refuse(path, MeshError, "unreadable|truncated|no triangles", capfd)
    path.write_bytes(b"\xef\xbb\xbf" + whole[:70])
    refuse(path, MeshError, "export", capfd)


def test_points_without_cells(tmp_path, capfd):
    path = tmp_path / "cloud.vtk"
    meshio.Mesh(POINTS, [("line", np.array([[0, 1]]))]).write(path)
    refuse(path, MeshError, "no tetrahedra and no triangles", capfd)


@pytest.mark.parametrize("suffix", VOLUMES)
def test_other_solids_beside_tetrahedra_are_not_left_out(tmp_path, suffix, capfd):
    """A cube of six tetrahedra on a hexahedron: a body without the latter would be half of one."""
    path = tmp_path / f"mixed{suffix}"
    corners = np.array(list(np.ndindex(2, 2, 3)), dtype=float)
    number = {tuple(corner): k for k, corner in enumerate(corners)}
    box = [number[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    ways = [(0, 1, 3, 7), (0, 1, 5, 7), (0, 2, 3, 7), (0, 2, 6, 7), (0, 4, 5, 7), (0, 4, 6, 7)]
    upper = [number[x, y, z] for x in (0, 1) for y in (0, 1) for z in (1, 2)]
    tets = np.array(upper)[np.array(ways)]
    meshio.Mesh(corners, [("tetra", tets), ("hexahedron", np.array([box]))]).write(path)
    refuse(path, MeshError, "1 of its cells are solids but no tetrahedra", capfd)


FACES = "labels of faces left out, for a surface has no regions"
LINES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n{0} a\nf 1 3 2\nf 1 2 4\n{0} b\nf 2 3 4\nf 1 4 3\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"


@pytest.mark.parametrize(
    ("name", "make", "said"),
    [
        ("g.obj", LINES.format("g"), [f"{FACES}: 2 (a, b)"]),
        ("m.obj", LINES.format("usemtl"), [f"{FACES}: 2 (a, b)"]),
        ("one.obj", LINES.format("g").replace("g b\n", ""), []),
        (
            "a.ply",
            PLY + "property list uchar int vertex_indices\nproperty uchar red\nproperty int label\nend_header\n"
            "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 9 4\n",
            [f"{FACES}: 1 (label)"],
        ),
        ("s.vtu", ("triangle", SHELL, {"material": [np.array([1, 1, 2, 3])]}), [f"{FACES}: 3 (1, 2, 3)"]),
        (
            "t.vtu",
            ("tetra", TETS, {"tag": [np.array([1, 2])], "size": [np.array([0.1, 0.2])]}),
            ["cell data that may be regions and is not read, rename it to region: 1 (tag)"],
        ),
        ("u.vtu", ("tetra", TETS, {"tag": [np.array([1, 2])], "region": [np.array([2, 1])]}), []),
        ("v.vtu", ("tetra", TETS, {"tag": [np.array([7, 7])]}), []),
    ],
)
def test_labels_that_are_lost_are_named_with_their_count(tmp_path, name, make, said):
    path = tmp_path / name
    if isinstance(make, str):
        path.write_text(make)
    else:
        kind, cells, data = make
        meshio.Mesh(POINTS, [(kind, cells)], cell_data=data).write(path)
    assert read_with_notes(path)[1] == said


@pytest.mark.skipif(not SHARED.exists(), reason="the shared meshes are not here")
@pytest.mark.parametrize(
    ("file", "found"),
    [
        ("meshes/surfaces/penguin.ply", 6720),
        ("meshes/surfaces/torus.off", 4608),
        ("meshes/tets/spot_ftetwild.mesh", {1: 16503}),
        ("meshes/tets/fish_tetgen.vtk", {0: 4142}),
        ("meshes/tets/rod.msh", {0: 1722}),
        ("cases/05-gmsh-saveall/u_groups_saveall.msh", {7: 718, 8: 737}),
        ("cases/05-gmsh-saveall/u_groups_face_saveall22.msh", {1: 718, 2: 737}),
        ("cases/07-gmsh-overlapping-groups/t04_multi_22_0.msh", {7: 718, 8: 737}),
        ("cases/07-gmsh-overlapping-groups/t04_multi_41_0.msh", {7: 718, 8: 737}),
        ("cases/08-ply-trailing-bytes/t02c_trailing.ply", 320),
        ("cases/08-ply-trailing-bytes/w1_bin_trail.stl", 320),
        ("cases/11-own-xdmf-not-read/f6_dolfinx.xdmf", {1: 81, 2: 81}),
        ("cases/11-own-xdmf-not-read/f6_series.xdmf", {0: 1455}),
        ("cases/11-own-xdmf-not-read/level_0.xdmf", {0: 36}),
        ("cases/16-convert-advice-fails/t03_poly.vtp", 320),
    ],
)
def test_shared_files(file, found):
    """Their triangles, or their cells by region."""
    shape = read_shape(SHARED / file)
    if isinstance(shape, Surface):
        check_surface(shape)
        assert len(shape.triangles) == found
    else:
        check_solid(shape)
        assert dict(Counter(shape.regions.tolist())) == found
