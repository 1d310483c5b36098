"""Point caches from Alembic files, and from USD files with a skeleton, against points by hand."""

import hashlib
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from pdvol import Placement, PointCache
from pdvol.errors import InputError
from pdvol.meshing.point_caches import cached_surface, read_frames

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0]], dtype=float)
FACES = [[0, 1, 2, 3], [1, 4, 2]]  # counter-clockwise as seen from +z
TRIANGLES = {frozenset(t) for t in ([0, 1, 2], [0, 2, 3], [1, 4, 2])}
FLOAT32 = 1e-6  # m: positions of a few metres


def one_line(error) -> str:
    assert "\n" not in str(error.value)
    return str(error.value)


# ---- Alembic


def matrix(shift, turn: float = 0.0):
    """Alembic's matrix, which multiplies rows from the right: a turn [rad] about z, then a shift."""
    from imath import M44d

    c, s = np.cos(turn), np.sin(turn)
    return M44d(c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, *shift, 1)


def alembic(
    path: Path, shapes=(POINTS, POINTS + [1.0, 0, 0]), places=((0, 0, 0), (0, 0, 1)), inherits=True, kind="PolyMesh"
):
    """/rig/hand/shape: points at 0.5 s and then every 0.4 s; /rig/hand rests, turned by 90 degrees and put 3 along x;
    /rig moves every 0.2 s from 0.5 s on; /still is a mesh that rests.
    """
    pytest.importorskip("alembic3d", reason="alembic3d is an optional extra")
    from alembic3d import Abc, AbcGeom
    from alembic3d.AbcCoreAbstract import TimeSampling
    from imath import IntArrayFromBuffer, V3fArrayFromBuffer

    archive = Abc.CreateArchiveWithInfo(str(path), 24.0, "a test", "")
    points_at, places_at = (archive.addTimeSampling(TimeSampling(pause, 0.5)) for pause in (0.4, 0.2))

    def placed(parent, name, samples, times=0, inherits=True):
        thing = AbcGeom.OXform(parent, name, times)
        for sample in samples:
            value = AbcGeom.XformSample()
            value.setMatrix(matrix(*sample))
            value.setInheritsXforms(inherits)
            thing.getSchema().set(value)
        return thing

    rig = placed(archive.getTop(), "rig", [(place,) for place in places], places_at)
    hand = placed(rig, "hand", [((3.0, 0, 0), np.pi / 2)], 0, inherits)
    corners = np.concatenate([face[::-1] for face in FACES]).astype(np.int32)
    counts = np.array([len(face) for face in FACES], dtype=np.int32)
    for parent, name, samples, times in ((hand, "shape", shapes, points_at), (archive.getTop(), "still", [POINTS], 0)):
        schema = getattr(AbcGeom, f"O{kind}")(parent, name, times).getSchema()
        for sample in samples:
            buffer = np.ascontiguousarray(sample, dtype=np.float32)
            value = getattr(AbcGeom, f"O{kind}SchemaSample")(
                V3fArrayFromBuffer(buffer), IntArrayFromBuffer(corners), IntArrayFromBuffer(counts)
            )
            schema.set(value)
    return path


def turned(points: np.ndarray) -> np.ndarray:
    """By 90 degrees about z, then 3 along x."""
    return np.column_stack([3.0 - points[:, 1], points[:, 0], points[:, 2]])


@pytest.mark.parametrize("kind", ["PolyMesh", "SubD"])
def test_an_alembic_mesh_gives_points_with_what_moves_above_it(tmp_path, kind):
    path = alembic(tmp_path / "rig.abc", places=((0, 0, 0), (0, 0, 1), (0, 0, 1), (0, 0, 5)), kind=kind)
    cache = PointCache(path, prim="/rig/hand/shape", begin=1.0, placement=Placement((0.0, 0.0, 10.0)))
    frames = read_frames(cache)
    np.testing.assert_allclose(frames.times, [1.0, 1.2, 1.4, 1.6])
    for k, (share, height) in enumerate(((0.0, 0.0), (0.5, 1.0), (1.0, 1.0), (1.0, 5.0))):
        expected = turned(POINTS + [share, 0, 0]) + [0, 0, 10.0 + height]
        np.testing.assert_allclose(frames.frame(k), expected, atol=FLOAT32)
    assert {frozenset(t) for t in frames.faces.tolist()} == TRIANGLES
    corners = cached_surface(cache).vertices[frames.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0.5).all(), "Alembic's faces are clockwise as seen from outside"


@pytest.mark.parametrize(
    ("change", "prim", "times", "last"),
    [
        ({"shapes": (POINTS,)}, "/rig/hand/shape", [0.0, 0.2], turned(POINTS) + [0, 0, 1]),
        ({}, "/still", [0.0], POINTS),
        ({"inherits": False}, "/rig/hand/shape", [0.0, 0.4], turned(POINTS + [1.0, 0, 0])),
    ],
    ids=["points rest", "all rests", "the place begins anew"],
)
def test_what_moves_in_alembic_moves_what_hangs_on_it(tmp_path, change, prim, times, last):
    frames = read_frames(PointCache(alembic(tmp_path / "rig.abc", **change), prim=prim, begin=2.0))
    np.testing.assert_allclose(frames.times, 2.0 + np.array(times))
    np.testing.assert_allclose(frames.frame(-1), last, atol=FLOAT32)


@pytest.mark.parametrize(
    "prim, change, said",
    [
        ("", {}, r"it has 2 meshes; give PointCache\(prim=...\), one of /rig/hand/shape, /still$"),
        ("/foot", {}, "it has no mesh '/foot'"),
        ("/rig/hand/shape", {"shapes": (POINTS, POINTS[:3])}, "has 3 points at 0.9 s and 5 before"),
        ("/rig/hand/shape", {"shapes": (POINTS[:3], POINTS[:3] + 1.0)}, "its faces do not fit its points"),
        ("/rig/hand/shape", {"shapes": (POINTS, POINTS * np.nan)}, "NaN or infinity in frame 1"),
    ],
)
def test_an_alembic_file_without_such_a_mesh_is_refused(tmp_path, prim, change, said):
    path = alembic(tmp_path / "rig.abc", **change)
    with pytest.raises(InputError, match=said) as error:
        read_frames(PointCache(path, prim=prim))
    one_line(error)


@pytest.mark.parametrize("damage", ["empty", "text", "half", "noise", "hdf5"])
def test_a_damaged_alembic_file_is_named(tmp_path, damage):
    path = alembic(tmp_path / "rig.abc")
    data = bytearray(path.read_bytes())
    if damage == "noise":
        for place in np.random.default_rng(0).integers(16, len(data), 400):
            data[place] ^= 0x5A
    if damage == "hdf5":  # as archives were once kept
        with h5py.File(path, "w") as file:
            file.attrs["abc_version"] = 1
    else:
        path.write_bytes({"empty": b"", "text": b"solid ball\n", "half": data[: len(data) // 2], "noise": data}[damage])
    with pytest.raises(InputError, match=r"rig\.abc: .*export") as error:
        read_frames(PointCache(path, prim="/rig/hand/shape"))
    assert "HDF5" in one_line(error) or damage != "hdf5"


def test_alembic_without_its_package(tmp_path, monkeypatch):
    (tmp_path / "rig.abc").write_bytes(b"Ogawa")
    monkeypatch.setitem(sys.modules, "alembic3d", None)
    with pytest.raises(InputError, match="pip install alembic3d"):
        read_frames(PointCache(tmp_path / "rig.abc"))


# ---- Skeletons in USD


def skeleton(path: Path, weights=((1, 0), (0.5, 0.5), (0, 1), (0.25, 0.75), (0, 1))):
    """Two joints at the origin: the first rests, the second turns by 90 degrees about z from time code 0 to 10 and
    rises by 1; 20 codes a second, in centimetres.
    """
    pytest.importorskip("pxr", reason="usd-core is an optional extra")
    from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.SetTimeCodesPerSecond(20.0)
    root = UsdSkel.Root.Define(stage, "/model")
    bones = UsdSkel.Skeleton.Define(stage, "/model/bones")
    identity = Gf.Matrix4d(1.0)
    bones.CreateJointsAttr(["arm", "hand"])
    bones.CreateBindTransformsAttr([identity, identity])
    bones.CreateRestTransformsAttr([identity, identity])
    animation = UsdSkel.Animation.Define(stage, "/model/bones/walk")
    animation.CreateJointsAttr(["arm", "hand"])
    still, half = Gf.Quatf(1, 0, 0, 0), float(np.sqrt(0.5))
    for code, turn, rise in ((0, still, 0.0), (10, Gf.Quatf(half, 0, 0, half), 100.0)):
        animation.CreateRotationsAttr().Set(Vt.QuatfArray([still, turn]), code)
        animation.CreateTranslationsAttr().Set(Vt.Vec3fArray([Gf.Vec3f(0), Gf.Vec3f(0, 0, rise)]), code)
        animation.CreateScalesAttr().Set(Vt.Vec3hArray([Gf.Vec3h(1), Gf.Vec3h(1)]), code)
    mesh = UsdGeom.Mesh.Define(stage, "/model/skin")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy((100 * POINTS).astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([len(face) for face in FACES])
    mesh.CreateFaceVertexIndicesAttr([corner for face in FACES for corner in face])
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([bones.GetPath()])
    binding.CreateJointIndicesPrimvar(False, 2).Set(Vt.IntArray([0, 1] * len(weights)))
    binding.CreateJointWeightsPrimvar(False, 2).Set(Vt.FloatArray([w for pair in weights for w in pair]))
    UsdSkel.BindingAPI.Apply(bones.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    assert root
    stage.GetRootLayer().Save()
    return path


@pytest.mark.parametrize("ending", ["usda", "usdc"])
def test_a_skeleton_moves_the_points_of_its_mesh(tmp_path, ending):
    """Linear blend skinning by hand: each point is the mean, by its weights, of where its joints take it."""
    path = skeleton(tmp_path / f"rig.{ending}")
    before = hashlib.sha256(path.read_bytes()).digest()
    frames = read_frames(PointCache(path))
    np.testing.assert_allclose(frames.times[[0, -1]], [0.0, 0.5])
    np.testing.assert_allclose(frames.frame(0), POINTS, atol=FLOAT32)
    share = np.array([0, 0.5, 1, 0.75, 1])[:, None]  # of the second joint
    quarter = np.column_stack([-POINTS[:, 1], POINTS[:, 0], POINTS[:, 2] + 1.0])
    np.testing.assert_allclose(frames.frame(-1), (1 - share) * POINTS + share * quarter, atol=FLOAT32)
    assert {frozenset(t) for t in frames.faces.tolist()} == TRIANGLES
    assert hashlib.sha256(path.read_bytes()).digest() == before, "the file stays as it is"


def test_instances_of_a_skeleton_move_each_at_its_place(tmp_path):
    skeleton(tmp_path / "rig.usda")
    instances = [
        f'def "{name}" (\n instanceable = true\n prepend references = @./rig.usda@</model>\n)\n{{\n'
        f' double3 xformOp:translate = ({place}, 0, 0)\n uniform token[] xformOpOrder = ["xformOp:translate"]\n}}\n'
        for name, place in (("one", 0), ("two", 500))
    ]
    head = "#usda 1.0\n(\n metersPerUnit = 0.01\n timeCodesPerSecond = 20\n)\n"
    (tmp_path / "two.usda").write_text(head + "".join(instances))
    one, two = (read_frames(PointCache(tmp_path / "two.usda", prim=prim)) for prim in ("/one", "/two/skin"))
    alone = read_frames(PointCache(tmp_path / "rig.usda"))
    for k in (0, -1):
        np.testing.assert_allclose(one.frame(k), alone.frame(k), atol=FLOAT32)
        np.testing.assert_allclose(two.frame(k), alone.frame(k) + [5.0, 0.0, 0.0], atol=4 * FLOAT32)


def test_a_skeleton_that_cannot_be_evaluated_is_named(tmp_path):
    path = skeleton(tmp_path / "rig.usda", weights=((1, 0), (0, 1)))
    with pytest.raises(InputError, match=r"rig.usda: the mesh /model/skin") as error:
        read_frames(PointCache(path))
    one_line(error)
