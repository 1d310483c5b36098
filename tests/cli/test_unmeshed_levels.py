"""Where a finer level has no mesh, the levels below it are simulated, and the command ends with its reason."""

import numpy as np
import pytest

import pdvol
from cli_scenes import pdvol as command
from cli_scenes import states, write
from pdvol import MeshError, open_run
from pdvol.measure.verify import verify_run
from pdvol.meshing import build
from pdvol.meshing.edge_length import SizedMesh, UnreachableCount
from pdvol.runs.scene_file import load_shot
from shapes import grid

SCENE = """
from pdvol import *

def scene(vertices=(12, 40, 90, 200), more=(14, 50, 110, 230), separate=()):
    box = Outline([(0.0, 0.0), (1.0, 0.0), (1.0, 0.6), (0.0, 0.6)])
    one = Body(box, NeoHookean(1e5), vertices, placement=Placement(translate=(0.0, 0.01)), name="one")
    other = Body(box, NeoHookean(1e5), more, placement=Placement(translate=(1.01, 0.01)), name="other")
    floor, gravity = Plane((0.0, 0.0), (0.0, 1.0)), Gravity((0.0, -9.81))
    apart = tuple(Separate(by) for by in separate)
    return Scene((one, other), dt=0.01, steps=3, loads=(gravity,), obstacles=(floor,), contact=(Barrier(),),
                 separate=apart)
"""
LINE = "pdvol: body 'other', level 2: 110 vertices cannot be had; ask for about 120 instead\n"


@pytest.fixture
def scene(tmp_path, monkeypatch, own_meshes):
    """A scene file. No mesh comes out for 100 to 119 vertices, nor for 190 or more; others are grids."""

    def mesher(loops, count, name):
        if 100 <= count < 120 or count > 190:
            raise UnreachableCount(f"{name}: {count} vertices cannot be had", count, 120)
        rows = round((0.6 * count) ** 0.5)
        low, high = loops[0].min(axis=0), loops[0].max(axis=0)
        made = grid(*(np.linspace(a, b, n) for a, b, n in zip(low, high, (count // rows, rows), strict=True)))
        return SizedMesh(made.points, made.cells, made.points)

    monkeypatch.setattr(build, "triangulate", mesher)
    return write(tmp_path / "scene.py", SCENE)


@pytest.mark.parametrize("separate", ["", "move"])
def test_levels_below_one_without_a_mesh_are_simulated(scene, tmp_path, capfd, separate):
    out, refined = tmp_path / "run", tmp_path / "refined"
    words = [scene, "--no-picture", *(["--set", f"separate=('{separate}',)"] if separate else [])]
    assert command("run", *words, "-o", out) == 2
    said = capfd.readouterr().err
    assert said.endswith(LINE) and said.count("pdvol: ") == 1 and f"{out}: states" in said
    assert open_run(out).info["state"] == "done" and len(open_run(out).levels) == 2 and verify_run(out) == []
    assert all((out / f"level_{level}.xdmf").is_file() == (level < 2) for level in range(3))
    before = states(out, 1)
    assert command("run", *words, "-o", out, "--resume") == 2 and states(out, 1) == before
    assert command("preview", *words, "-o", refined) == 0
    for last, code in ((1, 0), (3, 2)):
        assert command("refine", refined, "--to", last, "--no-picture") == code
    assert states(refined, 1) == before and capfd.readouterr().err.endswith(LINE)
    if not separate:
        assert command("run", *words, "-o", tmp_path / "beside", "--wavefront") == 2
        assert states(tmp_path / "beside", 1) == before and len(open_run(tmp_path / "beside").levels) == 2
    assert command("run", *words, "-o", tmp_path / "late", "--levels", "2:3", "--method", "direct") == 2
    assert not (tmp_path / "late").exists()
    assert command("check", scene, "--measure", 0) == 2
    assert f"defect: {LINE.removeprefix('pdvol: ')}" in capfd.readouterr().out


def test_from_python_the_error_comes_after_the_levels_below(scene, tmp_path):
    shot = load_shot(scene).scene
    with pytest.raises(MeshError, match="level 2: 110 vertices") as caught:
        pdvol.run(shot)
    assert "finished steps are kept" in caught.value.__notes__[0]
    steps = []
    with pytest.raises(MeshError, match="level 2: 110 vertices"):
        for step in pdvol.march(shot):
            steps.append((step.level, step.step))
    assert steps == [(level, step) for level in range(2) for step in (1, 2, 3)]
