"""Render meshes in exports, read again by independent readers: OpenUSD, trimesh; and through the command line."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import pdvol
from pdvol import Body, Gravity, NeoHookean, Placement, RenderMesh, Scene, Separate
from pdvol.cli import run as command
from pdvol.errors import InputError
from pdvol.store.copying import copy_run
from pdvol.store.reader import open_run
from pdvol.studio.export.exports import export_run
from rendered import grown_box
from shapes import solid

STEPS = 3
PLACE = Placement((0.0, 0.0, 2.0), 0.3, (1.0, 0.0, 0.0), 2.0)
TEXTURE = np.random.default_rng(0).integers(0, 255, (8, 16, 3)).astype(np.uint8)


def falling(*render, more=(), placement=PLACE, name="soft box"):
    """A box that falls without contact, on two levels, seen as `render`."""
    body = Body((solid(3, 1), solid(3, 2)), NeoHookean(1e4), name=name, placement=placement, render=render)
    return Scene((body, *more), 0.01, STEPS, loads=(Gravity((0.0, 0.0, -9.81)),))


SEAMS = RenderMesh(grown_box(0.0, 1.0, 0.02), TEXTURE)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    plain = Body((solid(3, 1), solid(3, 2)), NeoHookean(1e4), name="plain", placement=Placement((5.0, 0.0, 0.0)))
    path = tmp_path_factory.mktemp("render") / "run"
    pdvol.run(falling(SEAMS, RenderMesh(grown_box(0.3, 0.7, 0.0), interpolant="biharmonic"), more=(plain,)), path)
    return path


def expected(run, level, step, k=0):
    """By hand: without contact the box falls as it is."""
    fall = run.levels[level].positions(step)[0] - run.levels[level].rest[0]
    return PLACE(SEAMS.shape.vertices if k == 0 else grown_box(0.3, 0.7, 0.0).vertices) + fall


def test_alembic_has_texture_coordinates_by_corner(stored, tmp_path):
    Abc, Geom = pytest.importorskip("alembic3d.Abc"), pytest.importorskip("alembic3d.AbcGeom")
    from alembic3d.Abc import ISampleSelector

    (file,), _ = export_run(stored, "alembic", tmp_path, [1])
    top, given, shape = Abc.IArchive(str(file)).getTop(), {}, SEAMS.shape
    for place in (top.getChild(i) for i in range(top.getNumChildren())):
        given[place.getName()] = Geom.IPolyMesh(place, place.getChild(0).getName()).getSchema().getUVsParam()
    assert not given["plain"].valid()
    uvs = given["soft_box_render"]
    assert uvs.getScope() == Geom.GeometryScope.kFacevaryingScope
    found = np.array([tuple(uv) for uv in uvs.getExpandedValue(ISampleSelector(0)).getVals()])
    faces = np.split(shape.uvs[shape.uv_corners], np.cumsum(shape.counts)[:-1])
    np.testing.assert_allclose(found, np.concatenate([face[::-1] for face in faces]), atol=1e-7)


@pytest.mark.parametrize("level", [0, 1])
@pytest.mark.parametrize("kind", ["obj", "pc2"])
def test_obj_files_with_texture_coordinates(kind, level, stored, tmp_path):
    (folder, *_), notes = export_run(stored, kind, tmp_path, [level], **({"fps": 100.0} if kind == "pc2" else {}))
    assert len(notes) == 3 and "'soft box 1' stands out from the contact surface by up to 0.0693 m" in notes[0]
    found, names = {}, ["plain", "soft_box_render", "soft_box_render_1"]
    for file in [folder / f"{STEPS:06d}.obj"] if kind == "obj" else [folder / f"{name}.obj" for name in names]:
        # trimesh names what it has split by the first object of all; materials have the names of their objects.
        scene = trimesh.load(file, split_object=True, group_material=False, process=False, force="scene")
        found |= {thing.visual.material.name: thing for thing in scene.geometry.values()}
    assert {name: len(found[name].faces) for name in found} == dict(
        zip(names, ((12, 48)[level], 192, 192), strict=True)
    )
    run = open_run(stored)
    for k, shape in enumerate((SEAMS.shape, grown_box(0.3, 0.7, 0.0))):
        read = found[names[1 + k]]
        # trimesh makes a vertex of each pair of a corner and its place: compare corner by corner.
        points = expected(run, level, STEPS, k) if kind == "obj" else run.render_meshes[k].points
        np.testing.assert_allclose(read.vertices[read.faces], points[shape.triangles], atol=1e-7)
        np.testing.assert_allclose(read.visual.uv[read.faces.ravel()], shape.uvs[shape.uv_corners], atol=1e-8)
        if kind == "pc2":
            frames = np.frombuffer((folder / f"{names[1 + k]}.pc2").read_bytes(), "<f4", offset=32)
            last = frames.reshape(STEPS + 1, -1, 3)[STEPS]
            np.testing.assert_allclose(last, expected(run, level, STEPS, k), atol=1e-6)
    picture = found["soft_box_render"].visual.material.image
    np.testing.assert_array_equal(np.asarray(picture.convert("RGB")), TEXTURE)
    (contact, *_), _ = export_run(stored, kind, tmp_path / "contact", [level], surface="contact")
    text = "".join(file.read_text() for file in contact.glob("*.obj"))
    assert "o soft_box\n" in text and "_render" not in text


def test_usd_with_seams_and_texture(stored, tmp_path):
    pytest.importorskip("pxr", reason="usd-core is an optional extra")
    from pxr import Usd, UsdGeom, UsdShade

    (file,), _ = export_run(stored, "usd", tmp_path)
    run, stage = open_run(stored), Usd.Stage.Open(str(file))
    prim = stage.GetPrimAtPath("/run/bodies/soft_box_render")
    mesh, shape = UsdGeom.Mesh(prim), SEAMS.shape
    np.testing.assert_allclose(mesh.GetPointsAttr().Get(STEPS * 0.01 * 24), expected(run, 1, STEPS), atol=1e-6)
    st = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
    assert st.GetInterpolation() == "faceVarying"
    np.testing.assert_allclose(st.ComputeFlattened(), shape.uvs[shape.uv_corners], atol=1e-7)
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    shader, _, _ = material.ComputeSurfaceSource()
    source = shader.GetInput("diffuseColor").GetConnectedSources()[0][0].source
    picture = source.GetPrim().GetAttribute("inputs:file").Get()
    np.testing.assert_array_equal(np.asarray(Image.open(picture.resolvedPath)), TEXTURE)
    assert not stage.GetPrimAtPath("/run/bodies/soft_box") and stage.GetPrimAtPath("/run/bodies/plain")
    inner = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/run/bodies/soft_box_render_1"))
    assert inner.GetPrimvar("rest").HasValue() and inner.GetPrimvar("st").HasValue() is not None


def test_usd_with_each_surface(stored, tmp_path):
    """Fields are those of simulated surfaces; OpenUSD's validators find nothing."""
    pytest.importorskip("pxr", reason="usd-core is an optional extra")
    from pxr import Usd, UsdGeom

    for surface, has in ((None, ["plain"]), ("contact", ["soft_box", "plain"]), ("both", ["soft_box", "plain"])):
        (file,), notes = export_run(stored, "usd", tmp_path / str(surface), with_fields=True, surface=surface, fps=24.0)
        stage = Usd.Stage.Open(str(file))
        bodies = stage.GetPrimAtPath("/run/bodies").GetChildren()
        assert [b.GetName() for b in bodies if UsdGeom.PrimvarsAPI(b).HasPrimvar("strain")] == has
        said = "without fields of soft box: render meshes have none; --surface contact does"
        assert (said in notes) == (surface is None)
    purpose = lambda name: UsdGeom.Imageable(stage.GetPrimAtPath(f"/run/bodies/{name}")).ComputePurpose()
    assert [purpose(name) for name in ("soft_box", "soft_box_render", "plain")] == ["proxy", "render", "default"]
    UsdValidation = pytest.importorskip("pxr.UsdValidation", reason="usd-core before 25 has no validators")
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    assert [(error.GetName(), error.GetMessage()) for error in context.Validate(stage)] == []


def test_places_by_vertex_where_there_are_no_seams(tmp_path):
    pytest.importorskip("pxr", reason="usd-core is an optional extra")
    from pxr import Usd, UsdGeom

    flat = (
        np.array([[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0.5]]),
        [[0, 1, 2, 3]],
        [[0, 0], [1, 0], [1, 1], [0, 1]],
    )
    pdvol.run(falling(RenderMesh(flat)), tmp_path / "run")
    (file,), _ = export_run(tmp_path / "run", "usd", tmp_path / "out")
    stage = Usd.Stage.Open(str(file))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/run/bodies/soft_box_render"))
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert st.GetInterpolation() == "vertex" and list(mesh.GetFaceVertexCountsAttr().Get()) == [4]
    np.testing.assert_array_equal(st.ComputeFlattened(), flat[2])


def test_a_render_mesh_is_no_part_of_the_simulation(tmp_path):
    """A stored run takes another one without a step computed anew, and states do not depend on it."""
    path = tmp_path / "run"
    pdvol.run(falling(), path)
    assert open_run(path).render_meshes == ()
    states = {file: file.stat().st_mtime_ns for file in path.glob("levels/*/states.bin")}
    for render in ((SEAMS,), (SEAMS, RenderMesh(grown_box(0.2, 0.8, 0.0))), ()):
        pdvol.run(falling(*render), path, resume=True)
        assert len(open_run(path).render_meshes) == len(render)
        assert {file: file.stat().st_mtime_ns for file in path.glob("levels/*/states.bin")} == states
    assert falling(SEAMS).bodies[0].instances(Placement())[0].render == (SEAMS,)


def test_a_copy_of_a_run_has_its_render_meshes(stored, tmp_path):
    copy_run(stored, tmp_path / "copy", steps=2, levels=1)
    run, copy = open_run(stored), open_run(tmp_path / "copy")
    assert len(copy.render_meshes) == 2 and len(copy.levels) == 1
    a, b = (r.levels[0].render_weights(r.render_meshes[0]) for r in (run, copy))
    assert (a != b).nnz == 0 and copy.render_meshes[0].texture.read_bytes() == run.render_meshes[0].texture.read_bytes()


AGAIN = ".*--resume binds the render meshes again"


@pytest.mark.parametrize(
    ("file", "change", "said"),
    [
        (
            "render.json",
            {"texture": "../../secret.png"},
            "has the texture '../../secret.png', which is no file of this run",
        ),
        ("render.json", {"texture": "/etc/passwd"}, "has the texture '/etc/passwd', which is no file of this run"),
        ("render.json", {"texture": ".."}, "no file of this run"),
        ("render.json", {"texture": "1.png"}, "no file of this run"),
        ("render.json", {"texture": "0.link"}, "0.link is a link that leads out of the folder"),
        ("render.json", {"texture": ["0.png"]}, "is no list of render meshes"),
        ("render.json", {"name": 5}, "is no list of render meshes"),
        ("render.json", {"body": 99}, "render mesh 0 is of body 99, and there are 2"),
        ("render.json", {"body": -1}, "is of body -1"),
        ("render.json", {"body": True}, "is of body True"),
        ("render.json", {"body": "0"}, "is of body '0'"),
        ("render.json", b'{"render": [{"body": 0}]}', "render.json is no list of render meshes"),
        ("render/0.npz", "corners", "its corners do not fit its points"),
        ("render/0.npz", "uv_corners", "its uv_corners do not fit its uvs"),
        ("render/0.npz", "fans", "its fans do not fit its corners"),
        ("render/0.npz", "first", "its first do not fit its points"),
        ("levels/0/render_0.npz", "indices", "render_0.npz is damaged: " + AGAIN),
        ("levels/0/render_0.npz", "indptr", "render_0.npz is damaged: " + AGAIN),
        ("levels/1/render_0.npz", b"broken", "render_0.npz " + AGAIN),
        ("levels/1/render_0.npz", None, "render_0.npz is missing; .*--resume"),
    ],
)
def test_what_a_damaged_run_lacks_is_named(stored, tmp_path, file, change, said):
    """An entry of the list or an array is changed, or the file has other bytes, or is gone. No other file is read."""
    copy = tmp_path / "copy"
    copy_run(stored, copy)
    (tmp_path / "secret.png").write_bytes(b"\x89PNG secret")
    (copy / file).unlink()
    if change == {"texture": "0.link"}:
        (copy / "render" / "0.link").symlink_to(tmp_path / "secret.png")
    if isinstance(change, bytes):
        (copy / file).write_bytes(change)
    elif isinstance(change, dict):
        first, *others = json.loads((stored / file).read_text())["render"]
        (copy / file).write_text(json.dumps({"render": [{**first, **change}, *others]}))
    elif change is not None:
        with np.load(stored / file) as archive:
            arrays = dict(archive)
        arrays[change].ravel()[-1] += 10**6
        np.savez(copy / file, **arrays)
    with pytest.raises(InputError, match=said) as error:
        export_run(copy, "obj", tmp_path / "out")
    assert "\n" not in str(error.value)
    assert not any(b"secret" in file.read_bytes() for file in tmp_path.glob("out/**/*") if file.is_file())


def test_textures_that_are_lost_are_named_by_check_run_and_info(tmp_path, capfd):
    file, shape = tmp_path / "scene.py", tmp_path / "fine.obj"
    shape.write_text("mtllib fine.mtl\nv 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n")
    (tmp_path / "fine.mtl").write_text("newmtl a\nmap_Kd C:\\art\\skin.png\n")
    file.write_text(SCENE.replace("{file}", str(shape)))
    line = f"body 'cube', render mesh: {shape}: textures that are missing: 1 (skin.png); put what is missing beside"
    assert command(["check", str(file), "--measure", "0"]) == 0
    assert f"note: {line}" in capfd.readouterr().out
    assert command(["run", str(file), "--out", str(tmp_path / "run"), "--no-picture", "--no-xdmf"]) == 0
    assert f"note: {line}" in capfd.readouterr().err
    assert command(["info", str(tmp_path / "run")]) == 0
    assert f"weights; {line}" in capfd.readouterr().out
    Image.new("RGB", (2, 2)).save(tmp_path / "Skin.PNG")
    assert command(["run", str(file), "--out", str(tmp_path / "run"), "--no-picture", "--no-xdmf", "--resume"]) == 0
    assert "missing" not in capfd.readouterr().err
    assert open_run(tmp_path / "run").render_meshes[0].texture.read_bytes() == (tmp_path / "Skin.PNG").read_bytes()


def test_bodies_that_are_set_apart_take_their_render_meshes_along(tmp_path):
    """Two boxes overlap by 0.1; both are moved. The render mesh stays where it was on its body."""
    from pdvol import Barrier

    bodies = [
        Body((solid(3, 2),), NeoHookean(1e4), name=name, placement=Placement((0.9 * k, 0.0, 0.0)), render=SEAMS)
        for k, name in enumerate(("left", "right"))
    ]
    scene = Scene(tuple(bodies), 0.01, 1, contact=(Barrier(),), separate=(Separate("move", 0.2),))
    run = pdvol.run(scene, tmp_path / "run")
    for k, mesh in enumerate(run.render_meshes):
        corner = run.levels[0].mesh.body(k)[0].points.min(axis=0)
        np.testing.assert_allclose(mesh.points.min(axis=0), corner - 0.02, atol=1e-12)
    assert run.info["mended"]


SCENE = """
import numpy as np
from pdvol import *
from pdvol.meshes import box

def scene(file="{file}", texture=""):
    body = Body(box((1.0, 1.0, 1.0)), NeoHookean(1e4), (30,), "cube", render=RenderMesh(file, texture))
    return Scene((body,), 0.01, 1)
"""


TWO = "mtllib two.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 3 2 1\n"


@pytest.mark.parametrize(
    ("text", "words", "said"),
    [
        (None, (), "there is no such file"),
        (
            "v 0 0 0\nv 1000 0 0\nv 0 1000 0\nf 1 2 3\n",
            (),
            "it reaches 1e+03 m out of its body, whose diagonal is 1.73 m",
        ),
        ("v 9 0 0\nv 9 1 0\nv 9 0 1\nf 1 2 3\n", (), "give it in the coordinates of the body's shape"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 5\n", (), "faces use vertices that there are not"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", ("--set", "texture=gone.png"), "cannot be read"),
        (TWO, (), "(a.png, b.png); give RenderMesh(texture=...), or one RenderMesh(FILE, material=NAME) for each"),
        (TWO, ("--set", "texture=gone.png"), "gone.png cannot be read"),
    ],
)
def test_bad_input_is_one_line(tmp_path, capfd, text, words, said):
    file, shape = tmp_path / "scene.py", tmp_path / "fine.obj"
    if text is not None:
        shape.write_text(text)
    (tmp_path / "two.mtl").write_text("newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\n")
    for name in "ab":
        (tmp_path / f"{name}.png").touch()
    file.write_text(SCENE.replace("{file}", str(shape)))
    assert command(["run", str(file), "--out", str(tmp_path / "run"), "--no-picture", *words]) == 2
    line = capfd.readouterr().err.strip().splitlines()[-1]
    assert said in line and "Traceback" not in line and not (tmp_path / "run" / "run.json").exists()
    assert command(["check", str(file), "--measure", "0", *words]) == 2
    assert said in capfd.readouterr().out


@pytest.mark.parametrize(
    ("shape", "texture", "said"),
    [
        (3, "", "RenderMesh.shape must be a path"),
        ((np.zeros((3, 3)),), "", "has 1 entries"),
        ((np.zeros((3, 3)), [["a"]]), "", "the arrays are no surface"),
        ("a.obj", np.zeros((4, 4)), "must hold pixels"),
        ("a.obj", 5, "must be a path or an array"),
    ],
)
def test_bad_values(shape, texture, said):
    with pytest.raises(InputError, match=said):
        RenderMesh(shape, texture)
    with pytest.raises(InputError, match="render holds RenderMesh"):
        Body("a.obj", NeoHookean(1e4), (10,), render=("b.obj",))
    with pytest.raises(InputError, match="nosuch"):
        RenderMesh("a.obj", interpolant="nosuch")


def test_a_scene_in_2d_has_none(tmp_path):
    flat = pdvol.meshes.rectangle(1.0, 1.0)
    scene = Scene((Body(flat, NeoHookean(1e4), (10,), render=SEAMS),), 0.01, 1)
    with pytest.raises(InputError, match="this scene is 2D"):
        pdvol.run(scene, tmp_path / "run")
    assert not Path(tmp_path / "run").exists()
