"""Every demo builds its scene, and the two demos run short and coarse, through their first contact, with nothing interpenetrating."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from pdvol import Scene, open_run
from pdvol.cli import run

ROOT = Path(__file__).resolve().parents[2]
DEMOS = sorted((ROOT / "demos").glob("*.py"))
RUN_BY_A_TEST = {"ball_on_spike", "drop"}

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
