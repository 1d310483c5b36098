"""Point caches are read as their formats say, put into the scene, and refused in one line where they are damaged."""

import struct
from pathlib import Path

import numpy as np
import pytest

from hostile_files import obj
from pdvol.errors import InputError
from pdvol.meshes import Surface
from pdvol.meshing.point_caches import cached_surface, read_frames
from pdvol.runs.fingerprint import describe, differences
from pdvol.scene import Placement, PointCache

FRAMES = np.random.default_rng(0).normal(size=(4, 5, 3))
QUADS = [[0, 1, 2, 3], [0, 4, 1]]
TRIANGLES = [(0, 1, 2), (0, 2, 3), (0, 4, 1)]
FLAT = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, -1, 0]])


def pc2(path: Path, frames, start=3.0, rate=1.0, head=b"POINTCACHE2\0", version=1, samples=None) -> Path:
    """A PC2 file, written field by field."""
    frames = np.asarray(frames)
    header = head + struct.pack("<i", version) + struct.pack("<i", frames.shape[1]) + struct.pack("<f", start)
    header += struct.pack("<f", rate) + struct.pack("<i", len(frames) if samples is None else samples)
    path.write_bytes(header + b"".join(struct.pack("<f", x) for x in frames.ravel()))
    assert len(header) == 32
    return path


def usd(folder: Path, ending="usda", later=5) -> Path:
    """A quadrilateral and a triangle in centimetres at 25 codes a second: points at codes 0 and 10, `later` of them
    there, and a parent that moves until code 20; beside it a mesh that rests.
    """
    pytest.importorskip("pxr")
    from pxr import Gf, Usd, UsdGeom, Vt

    stage = Usd.Stage.CreateNew(str(folder / f"rig.{ending}"))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.SetTimeCodesPerSecond(25.0)
    shift = UsdGeom.Xform.Define(stage, "/rig").AddTranslateOp()
    shift.Set(Gf.Vec3d(0.0, 0.0, 0.0), 0)
    shift.Set(Gf.Vec3d(0.0, 0.0, 100.0), 20)
    moved = 100.0 * (FLAT + [1.0, 0.0, 0.0])[:later]
    for name, places in (("/rig/hand", {0: 100.0 * FLAT, 10: moved}), ("/still", {Usd.TimeCode.Default(): FLAT})):
        mesh = UsdGeom.Mesh.Define(stage, name)
        mesh.CreateFaceVertexCountsAttr([4, 3])
        mesh.CreateFaceVertexIndicesAttr([i for face in QUADS for i in face])
        points = mesh.CreatePointsAttr()
        for time, place in places.items():
            points.Set(Vt.Vec3fArray.FromNumpy(place.astype(np.float32)), time)
    stage.GetRootLayer().Save()
    return folder / f"rig.{ending}"


def damaged(frames=FRAMES, **change):
    """What reads a file with something changed in it."""
    return lambda folder: read_frames(PointCache(pc2(folder / "a.pc2", frames, **change), fps=24.0))


def test_a_pc2_file_gives_its_points_in_the_scene_at_times_from_its_beginning_on(tmp_path):
    place = Placement((0.0, 0.0, 1.0), angle=np.pi / 2, axis=(1.0, 0.0, 0.0), scale=0.01)
    frames = read_frames(PointCache(pc2(tmp_path / "a.pc2", FRAMES, rate=2.0), fps=24.0, begin=0.5, placement=place))
    np.testing.assert_allclose(frames.times, 0.5 + np.arange(4) * 2.0 / 24.0)
    for k in range(4):
        x, y, z = 0.01 * FRAMES[k].T
        np.testing.assert_allclose(frames.frame(k), np.column_stack([x, -z, y + 1.0]), atol=1e-8)


def test_points_move_straight_between_frames_and_rest_outside_them():
    frames, rows = read_frames(PointCache(FRAMES, times=(0.0, 0.1, 0.3, 0.4))), np.array([2, 0])
    for time, place in (
        (-1.0, FRAMES[0]),
        (0.0, FRAMES[0]),
        (0.1, FRAMES[1]),
        (0.15, 0.75 * FRAMES[1] + 0.25 * FRAMES[2]),
        (0.4, FRAMES[3]),
        (9.0, FRAMES[3]),
    ):
        np.testing.assert_allclose(frames.at(time, rows), place[rows], atol=1e-14)


def test_faces_come_from_an_obj_a_surface_or_an_array(tmp_path):
    (tmp_path / "rest.obj").write_bytes(obj(FLAT, QUADS))
    flat = np.array([FLAT, FLAT + 1.0])
    for faces in (tmp_path / "rest.obj", TRIANGLES, Surface(FLAT, np.array(TRIANGLES))):
        surface = cached_surface(PointCache(flat, fps=24.0, faces=faces), frame=-1)
        assert {frozenset(t) for t in surface.triangles.tolist()} == {frozenset(t) for t in TRIANGLES}
        np.testing.assert_array_equal(surface.vertices, FLAT + 1.0)
    (tmp_path / "rest.obj").write_bytes(obj(FLAT[:3], [(0, 1, 2)]))
    with pytest.raises(InputError, match="3 vertices and the point cache .* 5 points"):
        read_frames(PointCache(pc2(tmp_path / "a.pc2", FRAMES), fps=24.0, faces=tmp_path / "rest.obj"))


@pytest.mark.parametrize(
    "make, said",
    [
        (damaged(head=b"POINTCACHE3\0"), "not a PC2 file"),
        (damaged(version=2), "version 2"),
        (damaged(samples=9), "truncated, it promises 572 bytes and holds 272"),
        (damaged(samples=0), "0 samples"),
        (damaged(rate=0.0), "0 frames each"),
        (damaged(FRAMES * np.where(np.arange(4) == 2, np.nan, 1.0)[:, None, None]), "NaN or infinity in frame 2"),
        (lambda path: read_frames(PointCache(usd(path), prim="")), "2 meshes; .*one of /rig/hand, /still"),
        (lambda path: read_frames(PointCache(usd(path), prim="/foot")), "no mesh '/foot'"),
        (lambda path: read_frames(PointCache(usd(path, later=3), prim="/rig/hand")), "3 points at time code 10 and 5"),
        (lambda path: PointCache(path / "a.pc2"), "give fps"),
        (lambda path: PointCache(path / "a.fbx", fps=24.0), "unknown kind"),
        (lambda path: PointCache(path / "a.abc", fps=24.0), "times in seconds; leave fps out"),
        (lambda path: PointCache(path / "a.pc2", fps=24.0, times=(0.0,)), "times go with arrays"),
        (lambda path: PointCache(FRAMES), "times, or fps"),
        (lambda path: PointCache(FRAMES, times=(0.0, 1.0)), "2 times and 4 frames"),
        (lambda path: PointCache(FRAMES, times=(0.0, 1.0, 1.0, 2.0)), "ascend"),
        (lambda path: PointCache(FRAMES[0], fps=24.0), "shape"),
        (lambda path: PointCache(FRAMES * np.nan, fps=24.0), "NaN or infinity in frame 0"),
        (lambda path: PointCache(FRAMES, fps=0.0), "positive"),
        (lambda path: PointCache(FRAMES, fps=1.0, faces=[[0.5, 1.0, 2.0]]), "whole numbers"),
        (lambda path: read_frames(PointCache(FRAMES, fps=1.0, faces=[[0, 1, 5]])), "5 points, .* use number 5"),
        (lambda path: read_frames(PointCache(FRAMES, fps=1.0, faces=[[0, 1]])), "triangles"),
        (lambda path: read_frames(PointCache(FRAMES, fps=1.0, faces=path / "no.obj")), "no such file"),
        (lambda path: read_frames(PointCache(path / "no.pc2", fps=1.0)), "no such file"),
        (lambda path: cached_surface(PointCache(FRAMES, fps=1.0)), "without faces"),
        (lambda path: cached_surface(PointCache(FRAMES, fps=1.0, faces=TRIANGLES), 4), "no frame 4"),
    ],
)
def test_nonsense_is_refused_in_one_line(tmp_path, make, said):
    with pytest.raises(InputError, match=said) as error:
        make(tmp_path)
    assert "\n" not in str(error.value)


def test_a_scenes_description_has_what_a_cache_holds(tmp_path):
    path = pc2(tmp_path / "a.pc2", FRAMES)
    before = describe(PointCache(path, fps=24.0)), describe(PointCache(FRAMES, fps=24.0))
    pc2(path, FRAMES + 1.0)
    after = describe(PointCache(path, fps=24.0)), describe(PointCache(FRAMES + 1.0, fps=24.0))
    assert differences(before[0], after[0]) == ["scene.source: the contents of a.pc2 have changed"]
    assert differences(before[1], after[1]) == ["scene.source: the contents of the array have changed"]
    assert describe(PointCache(FRAMES.copy(), fps=24.0)) == before[1]


@pytest.mark.parametrize("ending", ["usda", "usdc"])
def test_a_usd_mesh_gives_points_in_metres_with_what_moves_above_it(tmp_path, ending):
    path = usd(tmp_path, ending)
    frames = read_frames(PointCache(path, prim="/rig/hand", begin=1.0))
    np.testing.assert_allclose(frames.times, [1.0, 1.4, 1.8])
    for k, shift in enumerate(([0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [1.0, 0.0, 1.0])):
        np.testing.assert_allclose(frames.frame(k), FLAT + shift, atol=1e-6)
    assert {frozenset(t) for t in frames.faces.tolist()} == {frozenset(t) for t in TRIANGLES}
    np.testing.assert_allclose(read_frames(PointCache(path, prim="/rig/hand", fps=10.0)).times, [0.0, 1.0, 2.0])


def test_usd_meshes_that_rest_and_all_below_a_prim(tmp_path):
    path = usd(tmp_path)
    still = read_frames(PointCache(path, prim="/still"))
    assert still.times.tolist() == [0.0] and still.faces.shape == (3, 3)
    np.testing.assert_allclose(still.frame(0), 0.01 * FLAT, atol=1e-6)
    both, hand = (read_frames(PointCache(path, prim=prim)) for prim in ("/", "/rig"))
    np.testing.assert_allclose(both.times, hand.times)
    for k in range(3):
        np.testing.assert_allclose(both.frame(k), np.concatenate([hand.frame(k), still.frame(0)]), atol=1e-12)
    assert both.faces.tolist() == [*hand.faces.tolist(), *(still.faces + 5).tolist()]
