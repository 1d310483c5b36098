"""Every kind of file is read, in one meaning; every kind of bad file gives one line and prints nothing."""

from collections import Counter
from pathlib import Path

import meshio
import numpy as np
import pytest

from pdvol.errors import InputError, MeshError
from pdvol.meshes import Solid, Surface
from pdvol.meshing.readers import SURFACES, VOLUMES, read_shape, read_with_notes
from pdvol.meshing.validate import check_solid, check_surface
from pdvol.meshing.volume_files import _with_vtk

SHARED = Path(__file__).parents[2].parent / "shared" / "meshes"
CASES = SHARED.with_name("cases")
POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
SHELL = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
TETS = np.array([[0, 1, 2, 3], [1, 2, 3, 4]])
LABEL = {".msh": "gmsh:physical", ".mesh": "medit:ref", ".vtk": "material", ".vtu": "material", ".xdmf": "region"}


def write(path, points, cells, labels=None):
    data = {} if labels is None else {LABEL[path.suffix]: [np.asarray(labels, dtype=np.int32)]}
    if path.suffix == ".msh" and labels is not None:
        data["gmsh:geometrical"] = data["gmsh:physical"]
    more = {"file_format": "gmsh22"} if path.suffix == ".msh" else {}
    meshio.Mesh(points, [cells], cell_data=data).write(path, **more)
    return path


@pytest.mark.parametrize("suffix", SURFACES)
def test_surfaces(tmp_path, suffix):
    surface = read_shape(write(tmp_path / f"a{suffix}", POINTS[:4], ("triangle", SHELL)))
    assert isinstance(surface, Surface)
    assert surface.vertices.shape == (4, 3), "STL corners are merged"
    check_surface(surface)


@pytest.mark.parametrize("suffix", VOLUMES)
def test_volumes_with_regions(tmp_path, suffix):
    solid = read_shape(str(write(tmp_path / f"a{suffix}", POINTS, ("tetra", TETS), [3, 8])))
    assert isinstance(solid, Solid)
    assert solid.vertices.shape == (5, 3)
    assert solid.regions.tolist() == [3, 8]
    check_solid(Solid(solid.vertices, solid.cells[:1], solid.regions[:1]))


@pytest.mark.parametrize("suffix", [s for s in VOLUMES if s != ".mesh"])
def test_flat_triangles_of_a_volume_format_are_a_2d_solid(tmp_path, suffix):
    solid = read_shape(write(tmp_path / f"a{suffix}", POINTS[:3], ("triangle", SHELL[:1, ::-1]), [4]))
    assert isinstance(solid, Solid)
    assert solid.vertices.shape == (3, 2)
    assert solid.regions.tolist() == [4]


def test_obj_with_seams_polygons_and_negative_indices(tmp_path):
    path = tmp_path / "quad.obj"
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0 1.0\nvt 0 0\nvt 1 0\nvn 0 0 1\n"
    path.write_text(f"{corners}f 1/1/1 2/2/1 3/1/1 4/2/1\nf -4//1 -2//1 -3//1\n")
    surface = read_shape(path)
    assert surface.vertices.shape == (4, 3)
    assert surface.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 2, 1]]


@pytest.mark.parametrize("suffix", SURFACES + VOLUMES)
def test_a_byte_order_mark_is_skipped(tmp_path, suffix):
    cells = ("triangle", SHELL) if suffix in SURFACES else ("tetra", TETS)
    path = write(tmp_path / f"a{suffix}", POINTS[: cells[1].max() + 1], cells)
    plain = read_shape(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    marked = read_shape(path)
    np.testing.assert_array_equal(marked.vertices, plain.vertices)
    name = "triangles" if suffix in SURFACES else "cells"
    np.testing.assert_array_equal(getattr(marked, name), getattr(plain, name))
    if suffix == ".stl":
        meshio.Mesh(plain.vertices, [("triangle", plain.triangles)]).write(path, binary=True)
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
        assert len(read_shape(path).triangles) == len(plain.triangles)
    if suffix in (".off", ".ply", ".msh", ".vtu"):
        path.write_bytes(path.read_bytes()[:70])
        with pytest.raises(MeshError, match=f"^{path}: "):
            read_shape(path)


@pytest.mark.skipif(not SHARED.exists(), reason="the shared meshes are not here")
@pytest.mark.parametrize(
    ("file", "vertices", "cells"),
    [
        ("surfaces/cube.obj", 26, 48),
        ("surfaces/penguin.ply", 3362, 6720),
        ("surfaces/torus.off", 2304, 4608),
        ("tets/spot_ftetwild.mesh", 4332, 16503),
        ("tets/fish_tetgen.vtk", 1219, 4142),
        ("tets/rod.msh", 630, 1722),
    ],
)
def test_shared_meshes(file, vertices, cells):
    shape = read_shape(SHARED / file)
    assert len(shape.vertices) == vertices
    assert len(shape.triangles if isinstance(shape, Surface) else shape.cells) == cells
    (check_surface if isinstance(shape, Surface) else check_solid)(shape, file)


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
def test_garbage(tmp_path, suffix, capfd):
    path = tmp_path / f"garbage{suffix}"
    path.write_bytes(np.random.default_rng(1).bytes(2000))
    refuse(path, MeshError, "unreadable|no triangles", capfd)


@pytest.mark.parametrize("share", [0.06, 0.2, 0.55])
@pytest.mark.parametrize("suffix", SURFACES + VOLUMES)
def test_truncated(tmp_path, suffix, share, capfd):
    path = tmp_path / f"cut{suffix}"
    write(path, POINTS[:4], ("triangle", SHELL)) if suffix in SURFACES else write(path, POINTS, ("tetra", TETS))
    whole = path.read_bytes()
    capfd.readouterr()
    # The writers put the cells last, but for VTU, whose closing tags are what goes missing.
    path.write_bytes(whole[: int(share * len(whole))])
    refuse(path, MeshError, "unreadable|truncated|no triangles", capfd)


def test_points_without_cells(tmp_path, capfd):
    path = tmp_path / "cloud.vtk"
    meshio.Mesh(POINTS, [("line", np.array([[0, 1]]))]).write(path)
    refuse(path, MeshError, "no tetrahedra and no triangles", capfd)


@pytest.mark.parametrize("suffix", VOLUMES)
def test_other_solids_beside_tetrahedra_are_not_left_out(tmp_path, suffix, capfd):
    """A cube of six tetrahedra on a hexahedron: a body without the latter would be half of one. VTK is asked, too."""
    path = tmp_path / f"mixed{suffix}"
    corners = np.array(list(np.ndindex(2, 2, 3)), dtype=float)
    number = {tuple(corner): k for k, corner in enumerate(corners)}
    box = [number[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    ways = [(0, 1, 3, 7), (0, 1, 5, 7), (0, 2, 3, 7), (0, 2, 6, 7), (0, 4, 5, 7), (0, 4, 6, 7)]
    upper = [number[x, y, z] for x in (0, 1) for y in (0, 1) for z in (1, 2)]
    tets = np.array(upper)[np.array(ways)]
    meshio.Mesh(corners, [("tetra", tets), ("hexahedron", np.array([box]))]).write(path)
    refuse(path, MeshError, "1 of its cells are solids but no tetrahedra", capfd)
    if suffix in (".vtk", ".vtu"):
        assert _with_vtk(path).cells[-1].type == "hexahedron"


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


@pytest.mark.skipif(not CASES.exists(), reason="the shared cases are not here")
@pytest.mark.parametrize(
    ("file", "regions"),
    [
        ("05-gmsh-saveall/u_groups_saveall.msh", {7: 718, 8: 737}),
        ("05-gmsh-saveall/u_groups_face_saveall22.msh", {1: 718, 2: 737}),
        ("07-gmsh-overlapping-groups/t04_multi_22_0.msh", {7: 718, 8: 737}),
        ("07-gmsh-overlapping-groups/t04_multi_41_0.msh", {7: 718, 8: 737}),
        ("08-ply-trailing-bytes/t02c_trailing.ply", None),
        ("08-ply-trailing-bytes/w1_bin_trail.stl", None),
        ("11-own-xdmf-not-read/f6_dolfinx.xdmf", {1: 81, 2: 81}),
        ("11-own-xdmf-not-read/f6_series.xdmf", {0: 1455}),
        ("11-own-xdmf-not-read/level_0.xdmf", {0: 36}),
        ("16-convert-advice-fails/t03_poly.vtp", None),
    ],
)
def test_shared_cases(file, regions):
    shape = read_shape(CASES / file)
    if regions is None:
        check_surface(shape)
        assert len(shape.triangles) == 320
    else:
        check_solid(shape)
        assert dict(Counter(shape.regions.tolist())) == regions
