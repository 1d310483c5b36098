"""Meshes of USD and Alembic files as shapes of bodies and obstacles: places, instances and units by hand."""

import re
from pathlib import Path

import numpy as np
import pytest

from pdvol import Body, Deforming, NeoHookean, PointCache, Rigid, Scene
from pdvol.errors import InputError
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.meshing.build import build_levels, read_obstacle
from pdvol.meshing.point_caches import read_frames
from pdvol.meshing.readers import read_with_notes
from pdvol.meshing.verdict import judge
from pdvol.runs.preflight import check_scene
from pdvol.runs.scene_file import load_shot

CASES = Path(__file__).parents[3].parent / "shared" / "cases"
CUBE = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
FACES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


def cube(name: str, more: str = "", inward: bool = False) -> str:
    corners = ", ".join(str(corner) for face in FACES for corner in face[:: -1 if inward else 1])
    points = ", ".join(f"({x}, {y}, {z})" for x, y, z in CUBE)
    return f"""def Mesh "{name}"
{{
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [{corners}]
    point3f[] points = [{points}]
    {more}
}}
"""


def placed(name: str, inside: str = "", instance_of: str = "", **steps: str) -> str:
    """A prim with its steps in space, the last of which is done first."""
    kinds = {"translate": "double3", "scale": "double3", "rotateZ": "float"}
    lines = "".join(f"    {kinds[step]} xformOp:{step} = {value}\n" for step, value in steps.items())
    order = ", ".join(f'"xformOp:{step}"' for step in steps)
    refers = f"(\n    instanceable = true\n    prepend references = {instance_of}\n)" if instance_of else ""
    return f'def Xform "{name}" {refers}\n{{\n{lines}    uniform token[] xformOpOrder = [{order}]\n{inside}}}\n'


INSTANCER = f"""def PointInstancer "many"
{{
    rel prototypes = [ </many/cube>, </many/group> ]
    int[] protoIndices = [0, 1, 0]
    point3f[] positions.timeSamples = {{ 0: [(0, 0, 0), (5, 0, 0), (9, 0, 0)], 12: [(0, 0, 1), (5, 0, 0), (9, 0, 0)] }}
    quath[] orientations = [(1, 0, 0, 0), (0.7071, 0, 0, 0.7071), (1, 0, 0, 0)]
    float3[] scales = [(1, 1, 1), (1, 1, 1), (2, 2, 2)]
    HIDDEN
{cube("cube")}{placed("group", cube("inner"), translate="(0, 1, 0)")}}}
"""
SHOWN = INSTANCER.replace("HIDDEN", "")
NESTED = """def PointInstancer "out"
{
    rel prototypes = [ </out/in> ]
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (0, 10, 0)]
    def PointInstancer "in"
    {
        rel prototypes = [ </lib/c> ]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0, 0), (4, 0, 0)]
    }
}
"""
PAIR = "".join(placed(name, instance_of="</_leaf>", translate=f"(0, {y}, 0)") for name, y in (("l", 2), ("r", -2)))


def usda(path: Path, text: str, unit: float = 1.0) -> Path:
    pytest.importorskip("pxr", reason="usd-core is an optional extra")
    path.write_text(f"#usda 1.0\n(\n    metersPerUnit = {unit}\n    timeCodesPerSecond = 24\n)\n{text}")
    return path


@pytest.mark.parametrize(
    ("text", "box", "volume", "notes"),
    [
        (
            placed("a", placed("b", cube("c"), rotateZ="90", scale="(1, 2, 1)"), translate="(3, 0, 0)"),
            (2, -0.5, -0.5, 4, 0.5, 0.5),
            2,
            "",
        ),
        (
            f'class "_leaf"\n{{\n{cube("c")}}}\nclass "_pair"\n{{\n{PAIR}}}\n'
            + placed("one", instance_of="</_pair>", translate="(1, 0, 0)")
            + placed("two", instance_of="</_pair>", translate="(9, 0, 0)", rotateZ="90"),
            (0.5, -2.5, -0.5, 11.5, 2.5, 0.5),
            4,
            r"one surface: 4 \(/one/l/c, /one/r/c, /two/l/c, /two/r/c\)$",
        ),
        (SHOWN, (-0.5, -1, -1, 10, 1, 1), 10, "it moves, and its first frame is read$"),
        (
            INSTANCER.replace("HIDDEN", "int64[] invisibleIds = [2]"),
            (-0.5, -0.5, -0.5, 4.5, 0.5, 0.5),
            2,
            r"2 \(/many\[0\], /many\[1\]/inner\)",
        ),
        (
            f'class "lib"\n{{\n{cube("c")}}}\n{NESTED}',
            (-0.5, -0.5, -0.5, 4.5, 10.5, 0.5),
            4,
            r"4 \(/out\[0\]\[0\], /out\[0\]\[1\], /out\[1\]\[0\], /out\[1\]\[1\]\)$",
        ),
        (
            placed("m", cube("c"), scale="(-1, 1, 1)", translate="(5, 0, 0)")
            + cube("left", 'uniform token orientation = "leftHanded"', inward=True),
            (-5.5, -0.5, -0.5, 0.5, 0.5, 0.5),
            2,
            "",
        ),
        (
            cube("seen")
            + placed("off", cube("c", 'token visibility = "invisible"'), translate="(3, 0, 0)")
            + placed("guide", cube("c", 'uniform token purpose = "guide"'), translate="(6, 0, 0)"),
            (-0.5, -0.5, -0.5, 0.5, 0.5, 0.5),
            1,
            r"left out, which pictures do not show: 2 \(/off/c, /guide/c\)$",
        ),
        (
            placed("wheel", instance_of="@./part.usda@</part>", translate="(2, 0, 0)")
            + placed("gone", instance_of="@./gone.usda@</part>"),
            (1.5, -0.5, -0.5, 2.5, 0.5, 0.5),
            1,
            r"references that cannot be read: 1 \(.*gone.usda",
        ),
        (
            cube("c", 'def GeomSubset "lid"\n{\n int[] indices = [1]\n}') + 'def Sphere "s"\n{\n}\n',
            (-0.5, -0.5, -0.5, 0.5, 0.5, 0.5),
            1,
            r"has no regions: 1 \(lid\)\|shapes left out, which are no meshes: 1 \(Sphere /s\)$",
        ),
    ],
    ids=["nested", "instances", "instancer", "masked", "instancers", "mirrored", "hidden", "references", "lost"],
)
@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_a_usd_file_is_a_shape(tmp_path, text, box, volume, notes, unit):
    usda(tmp_path / "part.usda", placed("part", cube("c")))
    shape, found = read_with_notes(usda(tmp_path / "scene.usda", text, unit))
    judge(shape, "it")
    found_box = [*shape.vertices.min(axis=0), *shape.vertices.max(axis=0)]
    np.testing.assert_allclose(found_box, unit * np.array(box), atol=3e-4 * unit)  # quaternions in half precision
    assert enclosed_volume(shape.vertices, shape.triangles) == pytest.approx(volume * unit**3, rel=1e-3)
    assert re.search(notes, "|".join(found)), found


@pytest.mark.parametrize(
    ("file", "settings", "notes"),
    [
        ("10-usd-instance/s.py", {}, []),
        ("12-vertexgroup-ply/s.py", {"use": "group"}, []),
        ("14-missing-texture-silent/s.py", {"file": "missing"}, ["textures that are missing: 1 (nothere.png)"]),
        ("14-missing-texture-silent/s.py", {"file": "winabs"}, []),
    ],
)
def test_scenes_that_were_handed_over_are_sound(file, settings, notes):
    if not CASES.is_dir():
        pytest.skip("needs the folder of handed-over cases")
    result = check_scene(load_shot(CASES / file, settings).scene, 0.0)
    lost = [note for note in result["notes"] if "texture" in note]
    assert result["sound"] and len(lost) == len(notes) and all(map(str.__contains__, lost, notes))


def test_instances_move_and_are_chosen_by_their_place(tmp_path):
    path = usda(tmp_path / "many.usda", SHOWN)
    whole, one, other = (read_frames(PointCache(path, prim=f"/many{part}")) for part in ("", "[0]", "[1]/inner"))
    np.testing.assert_allclose(whole.times, [0.0, 0.5])
    np.testing.assert_allclose(one.frame(1), CUBE + [0.0, 0.0, 1.0], atol=1e-6)
    np.testing.assert_allclose(whole.frame(1)[:16], np.concatenate([one.frame(1), other.frame(0)]), atol=1e-6)
    assert whole.faces.shape == (36, 3) and whole.faces.max() == 23
    with pytest.raises(InputError, match=r"3 meshes; give PointCache\(prim=...\), one of /many\[0\], /many\[1\]/inner"):
        read_frames(PointCache(path))


def test_a_file_that_was_written_anew_is_read_anew(tmp_path):
    """The process that reads waits for another file, and keeps none of USD's."""
    for x in (0.5, 0.75):
        shape, _ = read_with_notes(usda(tmp_path / "s.usda", cube("c").replace("0.5", str(x)) + " " * int(100 * x)))
        assert shape.vertices.max() == x


def test_bodies_and_obstacles_are_made_of_them(tmp_path):
    """A body of 1 m^3 from a file, a rigid and a deforming obstacle from another one of two instances."""
    text = f'class "_leaf"\n{{\n{cube("c")}}}\n' + "".join(
        placed(name, instance_of="</_leaf>", translate=f"({x}, 0, 0)") for name, x in (("a", 0), ("b", 3))
    )
    one, path = usda(tmp_path / "one.usda", cube("c")), usda(tmp_path / "two.usda", text)
    (level,) = build_levels(Scene((Body(one, NeoHookean(1e4), (60,), name="b"),), 0.01, 1), cache=tmp_path / "cache")
    assert level.volumes.sum() == pytest.approx(1.0, rel=1e-3)
    for obstacle in (Rigid(path, name="o"), Deforming(PointCache(path, prim="/b"), name="o")):
        points, _, faces = read_obstacle(obstacle)
        assert points[:, 0].max() == pytest.approx(3.5) and len(faces) == (24 if isinstance(obstacle, Rigid) else 12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('def Xform "a"\n{\n}\n', "it has no meshes; export meshes"),
        ('def Cube "c"\n{\n}\n', r"no meshes; shapes left out, which are no meshes: 1 \(Cube /c\); export meshes"),
        (SHOWN[:500], r"unreadable as USD \(.*\); export it again"),
        (SHOWN.replace("[0, 1, 0]", "[0, 7, 0]"), "prototypes that there are not"),
        (SHOWN.replace("</many/cube>", "</many>"), "is an instance of itself"),
        (cube("c").replace("[4, 4, 4", "[4, 4, 5"), "its faces do not fit its points"),
        ('def Mesh "m"\n{\n}\n', "the mesh /m has no points"),
    ],
)
def test_a_usd_file_without_a_shape_is_refused_in_one_line(tmp_path, text, said):
    with pytest.raises(InputError, match=rf"s.usda: .*{said}") as error:
        read_with_notes(usda(tmp_path / "s.usda", text))
    assert "\n" not in str(error.value)


def test_an_alembic_file_is_a_shape(tmp_path):
    """Two cubes, of which one is mirrored and 5 m away; a hidden one is left out."""
    pytest.importorskip("alembic3d", reason="alembic3d is an optional extra")
    from alembic3d import Abc, AbcGeom
    from imath import IntArrayFromBuffer, M44d, V3fArrayFromBuffer

    archive = Abc.CreateArchiveWithInfo(str(tmp_path / "s.abc"), 24.0, "a test", "")
    corners = np.concatenate([face[::-1] for face in FACES]).astype(np.int32)
    counts, points = np.full(6, 4, dtype=np.int32), np.ascontiguousarray(CUBE, dtype=np.float32)
    for name, x, scale, seen in (("a", 0, 1, True), ("b", 5, -1, True), ("c", 9, 1, False)):
        parent = AbcGeom.OXform(archive.getTop(), name, 0)
        place = AbcGeom.XformSample()
        place.setMatrix(M44d(scale, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, 0, 0, 1))
        parent.getSchema().set(place)
        if not seen:
            AbcGeom.CreateVisibilityProperty(parent, 0).setValue(0)
        sample = V3fArrayFromBuffer(points), IntArrayFromBuffer(corners), IntArrayFromBuffer(counts)
        AbcGeom.OPolyMesh(parent, "s").getSchema().set(AbcGeom.OPolyMeshSchemaSample(*sample))
    AbcGeom.OCurves(archive.getTop(), "line")
    del archive, parent
    shape, notes = read_with_notes(tmp_path / "s.abc")
    judge(shape, "it")
    assert enclosed_volume(shape.vertices, shape.triangles) == pytest.approx(2.0)
    assert shape.vertices[:, 0].max() == pytest.approx(5.5)
    assert notes == [
        "meshes that are read as one surface: 2 (/a/s, /b/s)",
        "meshes left out, which pictures do not show: 1 (/c/s)",
        "shapes left out, which are no meshes: 1 (Curve /line)",
    ]
