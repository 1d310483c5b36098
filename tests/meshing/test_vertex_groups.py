"""Parts of bodies that weights of a surface mark: by hand on a box, on all levels, in a description of the scene."""

import meshio
import numpy as np
import pytest
import trimesh

import pdvol
from hostile_files import obj
from pdvol import Barrier, Body, Gravity, NeoHookean, PointCache, Region, Scene, Support, VertexGroup, meshes
from pdvol.errors import InputError
from pdvol.levels.materials import cell_materials
from pdvol.meshing.point_caches import read_frames
from pdvol.meshing.readers import read_shape
from pdvol.runs.fingerprint import describe, differences

BOX = meshes.box((1.0, 2.0, 3.0))
TOP = BOX.vertices[:, 2] > 1.49


def saved(folder, surface, weights):
    (folder / "box.obj").write_bytes(obj(surface.vertices, surface.triangles))
    (folder / "top.txt").write_text("\n".join(map(str, weights)) + "\n")
    return folder / "box.obj", folder / "top.txt"


def test_faces_edges_and_vertices_can_be_marked():
    group, reach = VertexGroup(BOX, TOP.astype(float), reach=0.1), 0.1 * np.sqrt(14.0)
    X = np.array([[0, 0, 1.5], [0, 0, 1.5 - 0.99 * reach], [0, 0, 1.5 - 1.01 * reach], [0.5, 1.0, 1.5], [0, 0, -1.5]])
    assert group(X).tolist() == [True, True, False, True, False]
    edge = TOP & (BOX.vertices[:, 0] > 0.49)
    assert edge.sum() == 2  # the corners of a box with one face a side
    group = VertexGroup(BOX, edge.astype(float), reach=0.02)
    along = np.column_stack([np.full(41, 0.5), np.linspace(-1.0, 1.0, 41), np.full(41, 1.5)])
    assert group(along).all() and not group(along - np.array([0.1, 0.0, 0.0])).any()
    corner = (edge & (BOX.vertices[:, 1] > 0.0)).astype(float)
    held = VertexGroup(BOX, corner, reach=0.02)(along)
    assert held.nonzero()[0].tolist() == [39, 40]  # 0.075 m, and 0.05 m between points


def test_a_filled_group_has_what_is_nearest_to_marked_weights_at_any_depth():
    group = VertexGroup(BOX, TOP.astype(float), filled=True)
    sides = [[0.49, 0.0, height] for height in (1.4, 0.9, 0.1, -0.1, -1.4)]  # half of the weight is half of the height
    assert group(np.array(sides)).tolist() == [True, True, True, False, False]
    assert VertexGroup(BOX, np.ones(len(BOX.vertices)), filled=True)(np.zeros((1, 3))).all()


def test_files_say_the_same_and_are_part_of_the_scene(tmp_path):
    surface, weights = saved(tmp_path, BOX, TOP.astype(float))
    X = np.random.default_rng(0).uniform(-1.5, 1.5, (200, 3))
    group = VertexGroup(surface, weights)
    assert 0 < group(X).sum() < 200
    assert np.array_equal(group(X), VertexGroup(BOX, TOP.astype(float))(X))
    before = describe(group)
    weights.write_text(weights.read_text().replace("0.0", "1.0"))
    assert differences(before, describe(VertexGroup(surface, weights))) == [
        "scene.weights: the contents of top.txt have changed"
    ]


def seams(path):
    """BOX as a PLY file whose faces have places in a texture."""
    head = f"ply\nformat ascii 1.0\nelement vertex {len(BOX.vertices)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + f"element face {len(BOX.triangles)}\n"
    head += "property list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
    rows = [*BOX.vertices.tolist(), *([3, *t, 6, *range(k, k + 6)] for k, t in enumerate(BOX.triangles))]
    path.write_text(head + "".join(" ".join(map(str, row)) + "\n" for row in rows))


def exported(suffix):
    box = trimesh.Trimesh(BOX.vertices, BOX.triangles, process=False)
    box.visual.vertex_colors = np.full((len(BOX.vertices), 4), 9, dtype=np.uint8)
    return lambda path: box.export(path.with_suffix(suffix))


def tetrahedra(path):
    fans = np.column_stack([BOX.triangles, np.full(len(BOX.triangles), len(BOX.vertices))])
    meshio.Mesh(np.append(BOX.vertices, [[0, 0, 0]], axis=0), [("tetra", fans)]).write(path.with_suffix(".vtu"))


def triangles(path):
    meshio.Mesh(BOX.vertices, [("triangle", BOX.triangles)]).write(path.with_suffix(".vtu"))


@pytest.mark.parametrize("write", [seams, exported(".ply"), exported(".off"), triangles, tetrahedra])
def test_a_surface_of_any_kind_keeps_the_order_of_its_vertices(tmp_path, write):
    """Weights, and the points of a cache, belong to vertices by their number."""
    write(tmp_path / "box.ply")
    (path,) = tmp_path.iterdir()
    weights = np.append(TOP, np.zeros(len(read_shape(path).vertices) - len(TOP)))
    X = np.random.default_rng(0).uniform(-1.5, 1.5, (200, 3))
    assert np.array_equal(VertexGroup(path, weights)(X), VertexGroup(BOX, TOP.astype(float))(X))
    faces = read_frames(PointCache(np.zeros((2, len(weights), 3)), fps=24.0, faces=path)).faces
    assert {frozenset(t) for t in faces.tolist()} == {frozenset(t) for t in BOX.triangles.tolist()}


def test_a_pinned_and_a_stiff_part_are_the_same_on_all_levels(tmp_path):
    bar = meshes.box((1.0, 0.2, 0.2), (10, 2, 2))
    left, right = (bar.vertices[:, 0] < -0.49).astype(float), (bar.vertices[:, 0] > 0.2).astype(float)
    stiff = Region(NeoHookean(1e7), VertexGroup(bar, right, filled=True))
    body = Body(bar, NeoHookean(1e5), (80, 250), name="bar", regions=(stiff,))
    held, gravity = Support(VertexGroup(bar, left, reach=0.01), body="bar"), Gravity((0.0, 0.0, -9.81))
    scene = Scene((body,), dt=0.02, steps=3, supports=(held,), loads=(gravity,), contact=(Barrier(),))
    run = pdvol.run(scene, tmp_path / "run")
    for level in run.levels:
        end, free = level.rest[:, 0] < -0.49, level.rest[:, 0] > 0.0
        assert end.sum() >= 4
        assert np.array_equal(level.positions(3)[end], level.rest[end])
        assert (level.positions(3) - level.rest)[free, 2].mean() < -1e-3
    centres = run.levels[0].rest[run.levels[0].mesh.cells].mean(axis=1)[:, 0]
    young = cell_materials(scene, run.levels[0].mesh).young
    assert (young[centres > 0.25] == 1e7).all() and (young[centres < 0.05] == 1e5).all()


def test_weights_and_files_that_do_not_fit_are_refused(tmp_path):
    surface, weights = saved(tmp_path, BOX, TOP.astype(float))
    trimesh.Trimesh(BOX.vertices, BOX.triangles).export(tmp_path / "box.stl")
    (tmp_path / "words.txt").write_text("1 2 three")
    (tmp_path / "edge.obj").write_text("v 0 0 0\nf 1 2\n")
    for shape, given, said in (
        (BOX, np.zeros(8), "no vertex has a weight of 0.5 or more"),
        (BOX, np.ones(7), "7 weights for 8 vertices"),
        (BOX, np.full(8, np.nan), "NaN or infinity"),
        (tmp_path / "none.obj", weights, "^VertexGroup.surface: .*none.obj: there is no such file"),
        (tmp_path / "box.stl", weights, "^VertexGroup.surface: .*STL files do not number their vertices; export OBJ"),
        (surface, tmp_path / "none.txt", "no such file; check VertexGroup.weights"),
        (surface, tmp_path / "words.txt", "write one number on a line"),
        (tmp_path / "edge.obj", weights, "^VertexGroup.surface: .*face 'f 1 2' has no three corners.*; export"),
    ):
        with pytest.raises(InputError, match=said):
            VertexGroup(shape, given)(np.zeros((1, 3)))
