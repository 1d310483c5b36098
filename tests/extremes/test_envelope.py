"""The rows of the stability envelope (benchmarks/extremes/scenes.py): short here, at full length where they are marked
slow.
"""

from pathlib import Path

import pytest

import pdvol
from benchmarks.extremes import __main__ as extremes
from benchmarks.extremes import figures, scenes
from pdvol.levels.level_check import spin_kept
from pdvol.measure.verify import verify_run
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import load_shot
from pdvol.store.reader import open_run

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "benchmarks" / "extremes" / "scenes.py"
SHORT = {
    # row: steps, enough that something touches; random scenes try stiffness, Poisson's ratio and time steps
    "stiffness_ratio_1e10_soft_below": 4,
    "dt_1e-5_touching": 40,
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

ENDS = {"dhat_2.5_sizes": pdvol.InputError, "spin_1000": pdvol.InputError}
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
        assert [problem for problem in verify_run(out) if error is None or "done" not in problem] == []
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


# ---- named limits: each statement of benchmarks/extremes/NOTES.md about them is measured


def stored(tmp_path, name, steps=None):
    """The stored run of a row."""
    run_scene(load_shot(FILE, {"name": name}, steps), tmp_path / "run", how=Execution(xdmf=False))
    return open_run(tmp_path / "run")


@pytest.mark.parametrize(("integrator", "power", "turn"), [("implicit_euler", 2, 0.05), ("bdf2", 4, 0.1)])
def test_the_decay_of_a_spin(integrator, power, turn):
    """Both the exact loss and (1 + 2 n turn^p)^(-1/p) have kept^-p grow by 2 turn^p a step, but for terms of turn^2."""
    steps = 400
    exact = [1.0 - figures.rigid_loss(integrator, turn, n) for n in (steps, 2 * steps)]
    law = [spin_kept(integrator, turn, n) for n in (steps, 2 * steps)]
    for kept in (exact, law):
        assert (kept[1] ** -power - kept[0] ** -power) / steps == pytest.approx(2.0 * turn**power, rel=0.08)
    assert law[0] < 1.0 and exact == pytest.approx(law, abs=2.0 * turn**2)


@pytest.mark.parametrize(
    ("name", "spin", "integrator", "loss"),
    [("spin_2", 2.0, "implicit_euler", 0.0714), ("spin_2_bdf2", 2.0, "bdf2", 0.000715)],
)
def test_angular_momentum_of_a_free_body(tmp_path, name, spin, integrator, loss):
    """A stiff cube loses as much as a rigid body. Newton's tolerance, 3.5e-4 m/s, leaves 3e-4 of it."""
    measured, rigid = figures.lost_spin(stored(tmp_path, name), spin, integrator)
    assert rigid == pytest.approx(loss, rel=1e-2)
    assert measured == pytest.approx(rigid, abs=5e-4)


def test_a_cube_on_a_slope_creeps_as_the_smoothing_says(tmp_path):
    """At the default tolerance, which is eps_v: downhill by eps_v (1 - (1 - tan / mu)^(1/2)), and not sideways.

    The tolerance allows for speeds wrong by eps_v; what is found is 1 to 3 per cent off.
    """
    down, across, expected = figures.creep(stored(tmp_path, "slope_sticks", 150))
    assert down == pytest.approx(expected, rel=0.05)
    assert abs(across) < 0.01 * expected


def test_what_no_step_can_resolve_is_refused(tmp_path):
    for name, words in (("spin_1000", "which a step cannot resolve"), ("dhat_2.5_sizes", "is larger than the body")):
        with pytest.raises(pdvol.InputError, match=words):
            stored(tmp_path, name)
        assert not (tmp_path / "run").exists()
