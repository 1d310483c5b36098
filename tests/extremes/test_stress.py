"""The classic stress tests (benchmarks/stress/scenes.py): the smallest of them take their first steps."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pdvol
from benchmarks.common.scenes import first_order
from benchmarks.stress import __main__ as stress
from benchmarks.stress import scenes
from pdvol.measure.verify import verify_run
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import Shot, load_shot

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "benchmarks" / "stress" / "scenes.py"
QUICK_PAIRS = ("spike_spike", "wedge_crack", "cube_cliff")


@pytest.mark.parametrize(
    "name", [name if name in QUICK_PAIRS else pytest.param(name, marks=pytest.mark.slow) for name in scenes.PAIRS]
)
def test_erlebens_pairs_come_to_touch(tmp_path, name):
    out, deep = tmp_path / "run", name.endswith(("crack", "hole"))  # 0.65 m down
    run_scene(load_shot(FILE, {"name": f"erleben_{name}"}, 90 if deep else 30), out, how=Execution(xdmf=False))
    assert verify_run(out) == []
    assert max(json.loads(line)["contacts"] for line in (out / "log.jsonl").read_text().splitlines()) > 0


def test_an_arch_stands(tmp_path):
    """Of seven stones. Friction holds it: after a twentieth of a second they have hardly moved, and have not gathered
    speed; without friction the speed is 7 mm/s by then.
    """
    out, scene = tmp_path / "run", first_order(scenes.masonry_arch(7))
    run_scene(Shot(None, {}, replace(scene, steps=5)), out, how=Execution(xdmf=False))
    assert verify_run(out) == []
    (level,) = pdvol.open_run(out).levels
    assert np.abs(level.positions(5) - level.rest).max() < 1e-3
    assert np.abs(level.velocities(5)).max() < 2.71e-3


def test_the_command(tmp_path, capsys):
    words = ["--out", str(tmp_path), "--minutes", "0.005", "--scenes"]
    code, done = stress.main([*words, "erleben_cube_cliff"]), capsys.readouterr()
    assert code == 0, done.err
    (row,) = [line for line in done.out.splitlines() if line.startswith("| erleben_cube_cliff | 8 | 6 | 0.005 |")]
    assert "time limit" in row or "full time" in row
