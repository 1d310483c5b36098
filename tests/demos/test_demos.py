"""Every demo builds its scene and runs short and coarse, through its first contact, with nothing interpenetrating."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from pdvol import Scene, open_run
from pdvol.cli import run

ROOT = Path(__file__).resolve().parents[2]
DEMOS = sorted((ROOT / "demos").glob("*.py"))
RUN_BY_A_TEST = {"ball_on_spike", "drop", "phong", "rope_drop", "slit_array", "tracks"}

sys.path.insert(0, str(ROOT / "tests"))
import verify_run


def load(path):
    spec = importlib.util.spec_from_file_location(f"demo_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("demo", DEMOS, ids=lambda path: path.stem)
def test_builds_its_scene(demo):
    module = load(demo)
    scene = module.scene()
    assert isinstance(scene, Scene)
    assert scene.levels >= 2 and scene.steps > 0
    assert module.__doc__ and module.scene.__doc__
    assert len(demo.read_text().splitlines()) < 150
    assert demo.read_text().rstrip().endswith('if __name__ == "__main__":\n    pdvol.main(scene)')


def test_every_demo_is_run_by_a_test():
    assert {demo.stem for demo in DEMOS} == RUN_BY_A_TEST


def end(path, levels, steps):
    """The run, after what holds for every demo: all steps are there, nothing crosses, contact happened."""
    stored = open_run(path)
    assert [level.steps for level in stored.levels] == [steps + 1] * levels
    assert verify_run.verify(path) == []
    for level in stored.levels:
        assert max(record["contacts"] for record in level.log) > 0, f"level {level.index} touched nothing"
    return stored


def test_ball_on_spike(tmp_path):
    steps = 30
    assert run(["run", str(ROOT / "demos" / "ball_on_spike.py"), "--levels", "0:1", "--steps", str(steps), "--out", str(tmp_path / "run")]) == 0
    stored = end(tmp_path / "run", 2, steps)
    coarse, fine = (level.positions(steps).mean(0) for level in stored.levels)
    assert np.abs(coarse - fine).max() < 0.025  # the same animation: within a tenth of the radius
    scene = load(ROOT / "demos" / "ball_on_spike.py").scene()
    assert abs(len(stored.levels[0].rest) - scene.bodies[0].vertices[0]) <= 0.25 * scene.bodies[0].vertices[0]


def test_drop(tmp_path):
    # 0.4 m to fall at a fiftieth of a second a step: the stones are met at step 9.
    steps = 12
    words = ["--set", "vertices=(150, 400)", "--set", "height=0.9", "--set", "dt=0.02", "--steps", str(steps), "--out", str(tmp_path / "run")]
    assert run(["run", str(ROOT / "demos" / "drop.py"), *words]) == 0
    end(tmp_path / "run", 2, steps)


def test_rope_drop(tmp_path):
    scene = load(ROOT / "demos" / "rope_drop.py").scene()
    assert (scene.bodies[0].vertices, scene.dt) == ((100, 200, 400, 800, 1600), 0.01)
    # 2 cm to fall: the ground is met at step 7.
    steps = 12
    words = ["--levels", "0:1", "--set", "height=0.02", "--steps", str(steps), "--out", str(tmp_path / "run")]
    assert run(["run", str(ROOT / "demos" / "rope_drop.py"), *words]) == 0
    coarsest = end(tmp_path / "run", 2, steps).levels[0]
    # One element wide: every triangle has its corners on the two long sides, but for the middles of the ends.
    assert len(np.unique(coarsest.surface)) >= len(coarsest.rest) - 2


def test_slit_array(tmp_path):
    scene = load(ROOT / "demos" / "slit_array.py").scene()
    assert (scene.levels, scene.dt, scene.steps) == (8, 0.04, 150)
    steps = 6
    words = ["--levels", "0:1", "--set", "height=0.05", "--set", "consistency=0.025", "--steps", str(steps), "--out", str(tmp_path / "run")]
    assert run(["run", str(ROOT / "demos" / "slit_array.py"), *words]) == 0
    stored = end(tmp_path / "run", 2, steps)
    assert max(record["energy"]["consistency"] for record in stored.levels[1].log) > 0.0


@pytest.mark.slow  # a minute of meshing where the ball's levels are not kept yet
def test_phong(tmp_path):
    steps = 8
    words = ["--set", "vertices=(60, 150)", "--set", "height=0.47", "--prolongation", "phong", "--steps", str(steps), "--out", str(tmp_path / "run")]
    assert run(["run", str(ROOT / "demos" / "phong.py"), *words]) == 0
    assert end(tmp_path / "run", 2, steps).info["prolongation"] == "phong"


def test_tracks(tmp_path):
    steps = 10
    words = ["--set", "vertices=(100, 200)", "--set", "height=0.02", "--method", "tracks", "--set", "weight=0.01", "--steps", str(steps),
             "--out", str(tmp_path / "run")]
    assert run(["run", str(ROOT / "demos" / "tracks.py"), *words]) == 0
    assert max(record["energy"]["consistency"] for record in end(tmp_path / "run", 2, steps).levels[1].log) > 0.0
