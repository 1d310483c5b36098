"""`check`, `hierarchy` and `run` say the same of every file, and `repair` mends what can be mended."""

import re

import numpy as np
import pytest

import hostile_files
from cli_scenes import pdvol
from cli_scenes import write as write_text
from hostile_files import CUBE, MENDED, SOUND, WRONG
from pdvol.meshes import Surface
from pdvol.meshing.readers import read_shape
from pdvol.meshing.verdict import judge

SCENE = """
import pdvol


def scene(spin=(0.0, 0.0, 0.0), dhat=1e-3, count=0):
    body = pdvol.Body({shape}, pdvol.NeoHookean(1e5), {targets}, spin=spin)
    return pdvol.Scene((body,), dt=0.01, steps=count, contact=(pdvol.Barrier(dhat=dhat),))
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    hostile_files.write(folder)
    return folder


def scene_of(path, folder):
    """A scene of a file: volume meshes as they are, surfaces with a mesh of 40 vertices."""
    volume = path.suffix in (".mesh", ".vtu", ".vtk", ".msh", ".node", ".ele")
    shape, targets = (f"({str(path)!r},)", "()") if volume else (repr(str(path)), "(40,)")
    return write_text(folder / "scene.py", SCENE.format(shape=shape, targets=targets))


def said(capfd, *words):
    capfd.readouterr()
    code = pdvol(*words)
    out, err = capfd.readouterr()
    assert "Traceback" not in out + err
    return code, out + err


@pytest.mark.parametrize("name", WRONG)
def test_all_refuse(files, tmp_path, capfd, name):
    path, match = files / name, WRONG[name][1]
    scene = scene_of(path, tmp_path)
    others = [("hierarchy", path, "--levels", 40, "-o", tmp_path / "levels"), ("check", scene, "--measure", 0)]
    other = others[list(WRONG).index(name) % 2]  # each for half of the files
    for words in (("check", path), other, ("run", scene, "--out", tmp_path / "run")):
        code, text = said(capfd, *words)
        (line,) = (line for line in text.splitlines() if re.search(match, line))
        assert code == 2 and line.startswith(("pdvol: ", "defect: ")), (words, text)
    assert not (tmp_path / "run").exists() and not (tmp_path / "levels").exists()


@pytest.mark.parametrize("name", SOUND)
def test_check_finds_sound_and_says_what_it_met(files, capfd, name):
    code, text = said(capfd, "check", files / name)
    assert code == 0 and ", sound" in text
    assert ("note: " in text) == bool(SOUND[name][1]) and re.search(SOUND[name][1], text)


@pytest.mark.parametrize("name", [name for name in SOUND if name.endswith((".mesh", ".node", ".vtu"))])
def test_what_check_finds_sound_is_run(files, tmp_path, capfd, name):
    scene = scene_of(files / name, tmp_path)
    code, text = said(capfd, "check", scene, "--measure", 0)
    assert code == 0 and re.search(SOUND[name][1], text)
    assert said(capfd, "run", scene, "--out", tmp_path / "run")[0] == 0


def test_surfaces_that_are_sound_get_levels(files, tmp_path, capfd):
    code, text = said(capfd, "hierarchy", files / "inward.obj", "--levels", 500, "-o", tmp_path / "levels")
    assert (code == 0 and "note: body 'inward': all triangles face inward" in text) or "closest mesh" in text


@pytest.mark.parametrize("name", ["bom.obj", "collinear.obj", "collinear.off", "unwelded.obj", "unused.obj"])
def test_files_of_a_cube_are_read_as_one(files, name):
    cube = judge(read_shape(files / name), name)[0]
    a, b, c = (cube.vertices[cube.triangles[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(1.0)
    assert len(cube.vertices) == (9 if "collinear" in name else len(CUBE.vertices))


def test_a_pair_of_files_has_regions(files):
    for name in ("pair.node", "pair.ele"):
        solid = read_shape(files / name)
        assert solid.cells.tolist() == [[0, 1, 2, 3], [1, 4, 2, 3]] and solid.regions.tolist() == [7, 8]


@pytest.mark.parametrize(
    ("setting", "match"),
    [
        ("spin=(0.0, 0.0, 400.0)", "turns it by 4 rad in a step of 0.01 s, which a step cannot resolve"),
        ("dhat=3.0", "dhat = 3 m is larger than the body"),
    ],
)
def test_settings_that_stop_a_run(files, tmp_path, capfd, setting, match):
    scene = scene_of(files / "inverted.mesh", tmp_path)
    for words in (("check", scene, "--measure", 0), ("run", scene, "--out", tmp_path / "run")):
        code, text = said(capfd, *words, "--set", setting)
        assert code == 2 and sum(match in line for line in text.splitlines()) == 1, text


def test_settings_that_spoil_one_are_noted(files, tmp_path, capfd):
    scene = scene_of(files / "sliver.mesh", tmp_path)
    lossy = ("--set", "count=20", "--set", "integrator=implicit_euler")
    for spin, words in ((100.0, "turns it by 1 rad a step"), (10.0, "takes 15 % of it within 0.2 s")):
        code, text = said(capfd, "check", scene, "--measure", 0, "--set", f"spin=(0, 0, {spin})", *lossy)
        assert code == 0 and [line for line in text.splitlines() if "note: body 'body'" in line and words in line], text


# ---- repair


@pytest.mark.parametrize("name", MENDED)
def test_repair_makes_bodies(files, tmp_path, capfd, name):
    out = tmp_path / f"mended{files.joinpath(name).suffix}"
    code, text = said(capfd, "repair", files / name, "-o", out)
    assert code == 0 and text.splitlines()[-1].endswith(", sound"), text
    assert len(text.splitlines()) > 1, "it says what it did"
    assert ("united" in text) == (name == "crossing.obj")
    if out.suffix == ".mesh":
        assert said(capfd, "run", scene_of(out, tmp_path), "--out", tmp_path / "run")[0] == 0
    elif name in ("doubled.obj", "twice.obj", "nearly_welded.obj", "half_turned.obj", "flat_triangle.obj"):
        surface = read_shape(out)
        assert isinstance(surface, Surface) and len(surface.vertices) == len(CUBE.vertices)


def test_repair_says_what_it_did_with_counts(files, tmp_path, capfd):
    mend = lambda name, *more: said(capfd, "repair", files / name, "-o", tmp_path / "mended.obj", *more)[1]
    assert "12 doubled cells dropped" in mend("doubled.obj")
    assert "28 vertices welded to others" in mend("nearly_welded.obj")
    assert "5 triangles turned to agree with their neighbours" in mend("half_turned.obj")
    assert "1 holes filled" in mend("open.obj")
    assert "2 vertices made of those in which parts met" in mend("pinched.obj")
    assert "4 vertices made of those in which parts met" in mend("shared_edge.obj")
    assert "1 triangles without area dropped" in mend("flat_triangle.obj")
    assert "nothing to mend" in mend("collinear.obj")
    assert "of up to 0.499 diagonals, longer than --hole 0.01; --hole 0.5 closes it" in mend(
        "open.obj", "--hole", "0.01"
    )


def test_repair_refuses_what_it_cannot_write(files, tmp_path, capfd):
    for out, more in ((files / "open.obj", ()), (tmp_path / "a.stl", ()), (tmp_path / "a.obj", ("--weld", "nan"))):
        code, text = said(capfd, "repair", files / "open.obj", "-o", out, *more)
        assert code == 2 and text.startswith("pdvol: ") and not (tmp_path / "a.obj").exists()


def test_the_converter_of_an_unread_kind_is_named(tmp_path, capfd):
    for name, line in (("a.fbx", "assimp export a.fbx a.obj"), ("b.inp", "meshio convert b.inp b.vtu")):
        (tmp_path / name).write_text("x")
        assert line in said(capfd, "check", tmp_path / name)[1]
