"""Levels keep flat faces, sharp edges and corners, and choices by place hold the same part of the shape on each."""

import gmsh
import numpy as np
import pytest

import pdvol
from pdvol import Body, Gravity, NeoHookean, Scene, Support, meshes
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.flat_faces import FlatFaces
from pdvol.geometry.level_mesh import facet_sizes, simplex_volumes
from pdvol.levels.scene_fields import chosen_points
from pdvol.meshes import Outline, Surface
from pdvol.meshing.build import build_levels
from pdvol.meshing.edge_length import ACCEPTED_DEVIATION
from pdvol.meshing.remesh import LEAST_QUALITY, Unsuited, remesh
from pdvol.meshing.tetrahedralise import mean_ratio, tetrahedralise
from pdvol.meshing.triangulate import triangulate
from pdvol.meshing.verdict import place_of, solid_boundary

BAR = meshes.brick((1.0, 0.2, 0.2), (5, 1, 1))
COMB = meshes.comb()
ARC = np.linspace(-np.pi / 2, np.pi / 2, 33)
STADIUM = np.vstack([np.column_stack([s * (np.cos(ARC) + 2.0), s * np.sin(ARC)]) for s in (1.0, -1.0)])


def cut_ball():
    """A ball whose cap below y = -0.5 is cut off."""
    polar = np.linspace(np.arccos(-0.5), 0.0, 16)
    return meshes.turned(np.column_stack([np.append(0.0, np.sin(polar)), np.append(-0.5, np.cos(polar))]), 32)


def filleted():
    """A block 1 x 0.6 x 0.4 all of whose edges are rounded by 0.08, as a CAD program's mesh."""
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    block = gmsh.model.occ.addBox(0.0, 0.0, 0.0, 1.0, 0.6, 0.4)
    gmsh.model.occ.synchronize()
    gmsh.model.occ.fillet([block], [tag for _, tag in gmsh.model.getEntities(1)], [0.08])
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 16)
    gmsh.model.mesh.generate(2)
    points = gmsh.model.mesh.getNodes()[1].reshape(-1, 3)
    triangles = gmsh.model.mesh.getElementsByType(2)[1].reshape(-1, 3) - 1
    gmsh.finalize()
    return Surface(points, triangles.astype(np.int32))


SHAPES = {
    # name: (shape, axis across a face at its lowest coordinate, size of the face)
    "bar": (BAR, 0, 0.04),
    "cube": (meshes.box(), 2, 1.0),
    "comb": (meshes.extrude(meshes.comb(teeth=3), 0.1), 2, None),
    "cylinder": (meshes.cylinder(), 1, None),
    "cut ball": (cut_ball(), 1, None),
    "flat comb": (COMB, 0, np.ptp(COMB.points[np.isclose(COMB.points[:, 0], COMB.points[:, 0].min()), 1])),
    "stadium": (Outline(STADIUM), 1, None),
    "fillets, bottom": (filleted(), 2, None),
    "fillets, end": (filleted(), 0, None),
}


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Meshes of shapes with two faces are made once."""
    return tmp_path_factory.mktemp("meshes")


@pytest.mark.parametrize("name", SHAPES)
def test_a_support_by_place_holds_the_same_face_on_every_level(name, cache):
    shape, axis, size = SHAPES[name]
    points = place_of(shape)
    support = Support(lambda X: np.isclose(X[:, axis], points[:, axis].min()))
    scene = Scene((Body(shape, NeoHookean(1e5), (150, 400)),), supports=[support], dt=0.01, steps=1)
    held = []
    for mesh in build_levels(scene, cache=cache):
        chosen = chosen_points(scene, scene.supports[0], mesh)
        facets = mesh.boundary[chosen[mesh.boundary].all(axis=1)]
        assert np.ptp(mesh.points[facets][..., axis]) < 1e-9
        held.append(facet_sizes(mesh.points, facets).sum())
    assert held == pytest.approx([np.mean(held) if size is None else size] * 2, rel=1e-9 if size else 0.1)


HULL, PLATE = solid_boundary(BAR, "bar"), meshes.box((0.9, 0.9, 0.02))
SOLIDS = [(HULL, 100), (HULL, 300), (meshes.box(), 100), (PLATE, 300), (meshes.ball(), 1000)]


@pytest.mark.parametrize(("shape", "target"), SOLIDS)
def test_counts_and_cells_of_remeshed_solids(shape, target):
    made = remesh(shape, target)
    few = 0.05 if target == 100 else 0.0  # one row of vertices along a bar is a fifth of them
    assert abs(len(made.points) / target - 1.0) <= ACCEPTED_DEVIATION + few
    assert mean_ratio(made.points, made.cells).min() >= LEAST_QUALITY
    volume = simplex_volumes(made.points, made.cells).sum()
    assert volume == pytest.approx(enclosed_volume(shape.vertices, shape.triangles), rel=1e-9)


@pytest.mark.parametrize(
    ("make", "shape", "target"),
    [
        (remesh, meshes.cylinder(), 200),
        (tetrahedralise, meshes.bar(1.0, 0.2, 0.2, 0.1), 200),
        (triangulate, [COMB.points], 150),
    ],
)
def test_one_input_gives_one_mesh(make, shape, target):
    first, second = (make(shape, target) for _ in range(2))
    assert np.array_equal(first.points, second.points) and np.array_equal(first.cells, second.cells)


def test_detail_finer_than_an_edge_is_left_to_decimation():
    with pytest.raises(Unsuited, match="round by"):
        remesh(meshes.bunny(), 200)


ROUND = [(meshes.cylinder(), 2), (meshes.ball(), 0), (meshes.donut(), 0), (cut_ball(), 1)]
FLAT = [(meshes.box((1.0, 1.0, 1.0), (3, 3, 3)), 6), (meshes.extrude(meshes.disc(), 0.2), 2)]


@pytest.mark.parametrize(("shape", "count"), ROUND + FLAT)
def test_flat_faces_are_not_facets_of_curved_surfaces(shape, count):
    assert len(FlatFaces(shape.vertices, shape.triangles.astype(np.int64)).facets) == count


def test_decimated_shapes_keep_flat_faces_too():
    """Quadrics and fTetWild leave vertices near the plane of a cut ball: they are moved onto it."""
    ball = cut_ball()
    made = tetrahedralise(ball, 300, flat=FlatFaces(ball.vertices, ball.triangles))
    assert np.isclose(made.points[:, 1], -0.5, atol=1e-12).sum() > 15


def test_a_bar_sags_alike_on_coarse_and_fine_levels():
    """Held at its end by `np.isclose`, or by all that is as far out: 300 vertices sag within 5 % of 2,500."""
    sags = []
    for count, where in ((300, lambda X: X[:, 0] < X[:, 0].min() + 1e-6), (2500, lambda X: np.isclose(X[:, 0], -0.5))):
        bodies, gravity = (Body(BAR, NeoHookean(1e5, 0.3), (count,)),), Gravity((0.0, -2.0, 0.0))
        held = {"supports": [Support(where)], "loads": [gravity], "integrator": "implicit_euler"}
        level = pdvol.run(Scene(bodies, dt=0.5, steps=14, **held)).levels[0]
        end = np.isclose(level.mesh.points[:, 0], 0.5)
        sags.append((level.mesh.points - level.positions(14))[end, 1].mean())
    assert sags[0] == pytest.approx(sags[1], rel=0.05)
