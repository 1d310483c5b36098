"""Normals of exported corners: a cube keeps its edges, a ball is smooth, and both follow the motion."""

import numpy as np
import pytest

from pdvol.store.reader import open_run
from pdvol.store.writer import RunWriter
from pdvol.studio.export.exports import export_run
from pdvol.studio.export.normals import CornerNormals
from pdvol.studio.export.parts import body_parts
from runs import ball
from shapes import box, together

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def cube_and_ball(tmp_path_factory):
    """A cube and a ball that turn by 90 degrees about z in a step."""
    path = tmp_path_factory.mktemp("stored") / "run"
    mesh = together(box(3, 2), ball(3, 200, (3.0, 0.0, 0.0)))
    with RunWriter.create(path, {"dt": 0.04, "steps": 1}, [mesh], ["cube", "ball"]) as run:
        run.write_state(0, 0, mesh.points)
        run.write_state(0, 1, mesh.points @ TURN.T)
    return path


def corner_normals(file, name: str, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (c, 3) and normals (c, 3) of the corners of a body, z upward, as the file's own library reads them."""
    if file.suffix == ".usdc":
        Usd, UsdGeom = pytest.importorskip("pxr.Usd"), pytest.importorskip("pxr.UsdGeom")
        stage = Usd.Stage.Open(str(file))
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/run/bodies/{name}"))
        primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
        assert primvar.GetInterpolation() == "faceVarying"
        normals = np.array(primvar.ComputeFlattened(step * 0.04 * 24))
        return np.array(mesh.GetPointsAttr().Get(step * 0.04 * 24))[mesh.GetFaceVertexIndicesAttr().Get()], normals
    Abc, Geom = pytest.importorskip("alembic3d.Abc"), pytest.importorskip("alembic3d.AbcGeom")
    from alembic3d.Abc import ISampleSelector

    top = Abc.IArchive(str(file)).getTop()
    (place,) = (top.getChild(i) for i in range(top.getNumChildren()) if top.getChild(i).getName() == name)
    schema = Geom.IPolyMesh(place, place.getChild(0).getName()).getSchema()
    value, given = schema.getValue(step), schema.getNormalsParam()
    assert given.getScope() == Geom.GeometryScope.kFacevaryingScope
    normals = np.array([tuple(v) for v in given.getExpandedValue(ISampleSelector(step)).getVals()])
    points = np.array([tuple(v) for v in value.getPositions()])[list(value.getFaceIndices())]
    z_up = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    return points @ z_up, normals @ z_up


@pytest.mark.parametrize("kind", ["usd", "alembic"])
def test_edges_of_a_cube_are_sharp_and_a_ball_is_smooth(kind, cube_and_ball, tmp_path):
    pytest.importorskip({"usd": "pxr", "alembic": "alembic3d"}[kind], reason="an optional extra")
    (file,), _ = export_run(cube_and_ball, kind, tmp_path)
    for step in (0, 1):
        points, normals = corner_normals(file, "cube", step)
        faces = points.reshape(-1, 3, 3)
        flat = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        flat *= np.sign(((faces.mean(axis=1) - points.mean(axis=0)) * flat).sum(axis=1, keepdims=True))
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        np.testing.assert_allclose(normals, np.repeat(flat, 3, axis=0), atol=1e-6)
        points, normals = corner_normals(file, "ball", step)
        outward = points - (TURN @ [3.0, 0.0, 0.0] if step else np.array([3.0, 0.0, 0.0]))
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        assert (normals * outward).sum(axis=1).min() > np.cos(np.radians(12.0))
        for corner in range(0, len(points), 7):
            same = (points == points[corner]).all(axis=1)
            np.testing.assert_array_equal(normals[same], np.broadcast_to(normals[corner], (same.sum(), 3)))


def test_as_few_normals_as_creases_need(cube_and_ball):
    """Each corner of the cube has three, each vertex within an edge two, all others one."""
    run = open_run(cube_and_ball)
    cube, round_one = body_parts(run, run.levels[0])
    on = (np.abs(cube.rest - cube.rest.mean(axis=0)) > 0.49 * np.ptp(cube.rest, axis=0)).sum(axis=1)
    assert CornerNormals(cube).index.max() + 1 == on.sum() and on.max() == 3
    assert CornerNormals(round_one).index.max() + 1 == len(round_one.rest)
