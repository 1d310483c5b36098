"""The rows of the stability envelope (benchmarks/extremes/scenes.py): short here, at full length where they are marked
slow.
"""

from pathlib import Path

import pytest

import pdvol
from benchmarks.extremes import __main__ as extremes
from benchmarks.extremes import scenes
from pdvol.measure.verify import verify_run
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import load_shot

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "benchmarks" / "extremes" / "scenes.py"
SHORT = {
    # row: steps, enough that something touches
    "young_1e2": 4,
    "young_1e11": 4,
    "stiffness_ratio_1e10_soft_below": 4,
    "poisson_0.499": 4,
    "dt_1e-5_touching": 40,
    "dt_0.1": 3,
    "impact_1000": 3,
    "impact_1000_dt_1e-4": 5,
    "dhat_1e-6": 3,
    "dhat_1e-1": 3,
    "mu_0": 4,
    "mu_10": 4,
    "mass_ratio_1e6_heavy_above": 6,
    "compress_99": 12,
    "twist_20_turns": 5,
    "size_1mm": 4,
    "size_1km": 4,
    "aspect_1e3_plates": 8,
    "aspect_1e3_needles": 8,
    "sheet_one_cell_thick": 6,
    "random_velocities_10": 3,
    "levels_8_dt_0.04": 2,
    "levels_8_flat_dt_0.04": 4,
    "levels_from_20_vertices": 4,
}

ENDS = {
    "random_velocities_100": pdvol.ConvergenceError,
    "impact_1000_dt_1e-4": pdvol.ConvergenceError,  # 100 times the speed of sound: BDF2 presses cells to 4e-4
    "dhat_2.5_sizes": pdvol.InputError,
    "spin_1000": pdvol.InputError,
}
"""Named errors of rows that do not come to their end."""


def march(tmp_path, name, steps=None):
    """The run of a row, or the named error it ended with; its states are sound in any case."""
    out = tmp_path / "run"
    error = None
    try:
        run_scene(load_shot(FILE, {"name": name}, steps), out, how=Execution(xdmf=False))
    except (pdvol.ConvergenceError, pdvol.InputError) as named:
        error = named
    if (out / "run.json").is_file():
        wrong = [problem for problem in verify_run(out) if error is None or "done" not in problem]
        assert wrong == []
    return error


LONG = ("levels_8_flat_dt_0.04", "levels_from_20_vertices")
"""Rows whose meshes take most of the time."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in SHORT]
)
def test_the_first_steps(tmp_path, name):
    assert march(tmp_path, name, SHORT[name]) is None


@pytest.mark.slow
@pytest.mark.parametrize("name", scenes.SCENES)
def test_a_row_at_full_length(tmp_path, name):
    assert type(march(tmp_path, name)) is ENDS.get(name, type(None))


def test_the_command(tmp_path, capsys):
    words = ["--out", str(tmp_path), "--rows"]
    code, done = extremes.main([*words, "mu_0"]), capsys.readouterr()
    assert code == 0, done.err
    assert [line.split(" | ")[0] for line in done.out.splitlines() if "| full time |" in line] == ["| mu_0"]
