"""Runs of scenes that a rig drives: each level follows the same file, and one that does not fit ends in one line."""

from pathlib import Path

import numpy as np
import pytest

import shapes
from cli_scenes import SQUARE, pdvol, write
from pdvol import open_run
from pdvol.measure.verify import verify_run

LID = (
    SQUARE
    + """
from pdvol import Deforming, PointCache


def scene(shift=0.0, steps=4):
    lid = PointCache(np.load("lid.npy"), times=(0.0, 0.1), faces=[[0, 1], [1, 2]])
    foot = PointCache(np.load("foot.npy"), fps=10.0, placement=Placement(translate=(shift, 0.0)))
    return Scene(
        bodies=(Body(tuple(square(n) for n in (2, 4)), NeoHookean(1e5), name="square"),),
        supports=(Support(lambda X: X[:, 1] < 1e-6, body="square", motion=foot),),
        obstacles=(Deforming(lid, name="lid", closed=False),),
        contact=(Barrier(dhat=0.01), Friction(0.3)),
        dt=0.025,
        steps=steps,
    )
"""
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder with a scene, the frames of a lid that bends down on a square, and of the foot below it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    lid = np.array([[-1.0, 1.2], [0.5, 1.2], [2.0, 1.2]])
    foot = np.column_stack([np.linspace(0.0, 1.0, 5), np.zeros(5)])
    np.save("lid.npy", [lid, lid - [[0.0, 0.0], [0.0, 0.35], [0.0, 0.0]]])
    np.save("foot.npy", [foot, foot + [0.2, 0.0]])
    write(tmp_path / "scene.py", LID)
    return tmp_path


def test_both_levels_follow_the_same_animation(folder):
    assert pdvol("run", "scene.py", "--out", "run", "--no-picture", "--no-xdmf") == 0
    assert verify_run("run") == []
    stored = open_run("run")
    for level in stored.levels:
        assert level.steps == 5 and max(record["contacts"] for record in level.log) > 0
        foot = level.rest[:, 1] < 1e-6
        np.testing.assert_allclose(level.positions(4)[foot], level.rest[foot] + [0.2, 0.0], atol=1e-9)
        assert level.positions(4)[:, 1].max() < 1.0
    lid = next(o for o in stored.obstacles if o.name == "lid")
    np.testing.assert_allclose(lid.vertices(2)[1], [0.5, 1.025])


def test_another_animation_is_refused_in_one_line(folder, capfd):
    assert pdvol("run", "scene.py", "--out", "run", "--set", "shift=0.75") == 2
    (line,) = capfd.readouterr().err.strip().split("\n")[-1:]
    assert line.startswith("pdvol: a support of body 'square', level 0: 2 of 3 vertices are further than 0.05 m")
    assert not (folder / "run").exists()
    assert pdvol("run", "scene.py", "--out", "run", "--steps", "2", "--no-picture", "--no-xdmf") == 0
    np.save("foot.npy", np.load("foot.npy") + 0.01)
    assert pdvol("run", "scene.py", "--out", "run", "--steps", "2", "--resume") == 2
    assert "scene.supports[0].motion.source: the contents of the array have changed" in capfd.readouterr().err


CHAINED = f"""
import sys; sys.path.insert(0, {str(Path(shapes.__file__).parent)!r})
import shapes
from math import pi
from pdvol import *


def scene(file="", prim="", turn=0.0, steps=4):
    body = Body((shapes.solid(3, 2),), NeoHookean(1e5), name="box", velocity=(1.0, 0.0, 0.0))
    led = PointCache(file, prim=prim, placement=Placement(angle=turn, axis=(1.0, 0.0, 0.0))) if file else None
    supports = (Support(lambda X: X[:, 2] < 1e-6, body="box", motion=led),) if file else ()
    return Scene(bodies=(body,), supports=supports, loads=(Gravity((0.0, 0.0, -9.81)),), dt=0.05, steps=steps)
"""


@pytest.mark.parametrize(
    "kind, library, file, prim, turn",
    [
        ("usd", "pxr", "out/first.usdc", "/run/bodies/box", 0.0),
        ("alembic", "alembic3d", "out/level_0.abc", "/box/boxShape", np.pi / 2),
    ],
)
def test_an_exported_run_drives_another_one(tmp_path, monkeypatch, capfd, kind, library, file, prim, turn):
    pytest.importorskip(library, reason="an optional extra")
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "scene.py", CHAINED)
    assert pdvol("run", "scene.py", "--out", "first", "--no-picture", "--no-xdmf") == 0
    assert pdvol("export", "first", "--format", kind, "-o", "out") == 0
    words = ["run", "scene.py", "--set", f"file={file}", "--set", f"prim={prim}", "--set", f"turn={turn}"]
    assert pdvol(*words, "--out", "second", "--no-picture", "--no-xdmf") == 0
    first, second = (open_run(name).levels[0] for name in ("first", "second"))
    foot = first.rest[:, 2] < 1e-6
    assert abs(first.positions(4)[foot] - first.rest[foot]).max() > 0.2
    for step in range(5):
        np.testing.assert_allclose(second.positions(step)[foot], first.positions(step)[foot], atol=2e-6)
    Path(file).write_bytes(Path(file).read_bytes()[:600])
    capfd.readouterr()
    assert pdvol(*words, "--out", "third") == 2
    (line,) = capfd.readouterr().err.strip().split("\n")[-1:]
    assert line.startswith(f"pdvol: {file}: ") and "export" in line
