"""A run that is resumed, refined or started again equals a run without interruption."""

import json
import shutil

import pytest

import runs
from cli_scenes import FALL, pdvol, states, write
from pdvol import open_run
from pdvol.measure.verify import verify_run

STEPS = 10
TIMING = ("seconds", "peak_memory_mb")


def assert_same_motion(one, other):
    first, second = open_run(one), open_run(other)
    assert len(first.levels) == len(second.levels)
    for a, b in zip(first.levels, second.levels, strict=True):
        assert states(one, a.index) == states(other, b.index)
        drop = [[{k: v for k, v in r.items() if k not in TIMING} for r in level.log] for level in (a, b)]
        assert drop[0] == drop[1]


def test_refine_keeps_relative_settings(tmp_path, scene):
    words = ["--set", "tolerance=Relative(1e-4)", "--steps", 3]
    assert pdvol("run", scene, *words, "--out", tmp_path / "whole") == 0
    assert pdvol("run", scene, *words, "--levels", "0", "--out", tmp_path / "run") == 0
    assert pdvol("refine", tmp_path / "run", "--to", 1) == 0
    assert_same_motion(tmp_path / "run", tmp_path / "whole")


def test_refine_does_not_touch_coarser_levels(tmp_path, scene, whole):
    out = tmp_path / "run"
    assert pdvol("run", scene, "--levels", "0", "--out", out) == 0
    before = states(out, 0)
    times = {p: p.stat().st_mtime_ns for p in (out / "levels" / "0").iterdir()}
    assert pdvol("refine", out, "--to", 1) == 0
    assert states(out, 0) == before
    assert {p: p.stat().st_mtime_ns for p in times} == times
    assert_same_motion(out, whole)
    assert (out / "level_1.xdmf").exists()
    log = (out / "log.jsonl").read_bytes()
    assert pdvol("refine", out, "--to", 1) == 0  # nothing left to do
    assert (out / "log.jsonl").read_bytes() == log
    assert pdvol("refine", out, "--to", 0) == 0
    assert len(open_run(out).levels) == 2


@pytest.mark.parametrize(("level", "step"), [(0, 0), (0, 4), (0, STEPS), (1, 0), (1, 1), (1, 7)])
def test_resume_equals_uninterrupted(tmp_path, scene, whole, level, step):
    # What a kill leaves: states up to a step of a level, nothing after, and a log one line ahead or torn.
    out = shutil.copytree(whole, tmp_path / "run")
    for later in range(level, 2):
        runs.keep_states(out / "levels" / str(later), step + 1 if later == level else 0)
    lines = (out / "log.jsonl").read_bytes().splitlines(keepends=True)
    kept = level * STEPS + step
    (out / "log.jsonl").write_bytes(b"".join(lines[:kept]) + (lines[kept][:40] if kept < len(lines) else b""))
    info = json.loads((out / "run.json").read_text())
    for later in range(level, 2):
        info["levels"][later]["state"] = "running" if later == level else "pending"
    (out / "run.json").write_text(json.dumps({**info, "state": "running"}))
    assert pdvol("run", scene, "--out", out, "--resume") == 0
    assert_same_motion(out, whole)
    assert open_run(out).info["state"] == "done"


@pytest.mark.parametrize("method", ["direct", "multilevel"])
def test_the_linear_solver_may_be_changed_on_resuming(tmp_path, scene, method):
    """A method that the settings name is the one in use, whatever the steps before were solved with."""
    out = tmp_path / "run"
    assert pdvol("run", scene, "--steps", 2, "--levels", "0", "--out", out) == 0
    assert (
        pdvol("run", scene, "--steps", 4, "--levels", "0", "--out", out, "--resume", "--set", f"linear={method}") == 0
    )
    assert [record["linear_solver"] for record in open_run(out).levels[0].log] == 2 * ["iterative"] + 2 * [method]


def test_other_solver_settings_leave_a_trace_and_hold_from_then_on(tmp_path, scene, capfd):
    """The folder says which steps had which; a later refine takes the last ones."""
    out = tmp_path / "run"
    loose, strict = ("--set", "tolerance=0.01"), ("--set", "tolerance=0.001")
    assert pdvol("run", scene, "--steps", 2, "--levels", "0", "--out", out, *loose) == 0
    assert pdvol("run", scene, "--steps", 4, "--levels", "0", "--out", out, "--resume", *strict) == 0
    assert "solver settings from step 3 of levels 0 to 0 on: solver.tolerance: 0.01 -> 0.001" in capfd.readouterr().err
    assert pdvol("refine", out, "--to", 1) == 0
    info = open_run(out).info
    assert [entry["from"] for entry in info["solvers"]] == [[1], [3]]
    assert [entry["settings"]["tolerance"] for entry in info["solvers"]] == [0.01, 0.001]
    assert info["parameters"]["tolerance"] in (0.001, "0.001")


def test_a_run_with_endless_motions_is_the_same_scene_again(tmp_path):
    """A motion's `stop` is infinity unless given, which run.json cannot hold."""
    moving = FALL.replace(
        "Plane((0.0, 0.0), (0.0, 1.0), ", "Plane((0.0, 0.0), (0.0, 1.0), motion=pdvol.Translation((0.0, 0.01)), "
    )
    scene, out = write(tmp_path / "moving.py", moving), tmp_path / "run"
    assert pdvol("run", scene, "--steps", 2, "--levels", "0", "--out", out) == 0
    assert pdvol("run", scene, "--steps", 3, "--levels", "0", "--out", out, "--resume") == 0
    assert open_run(out).levels[0].steps == 4


def test_a_simulation_that_cannot_go_on(tmp_path, scene, capfd):
    # One Newton iteration and no halving: ends with code 1, level and step named, what was done kept.
    out = tmp_path / "run"
    assert pdvol("run", scene, "--out", out, "--set", "max_iterations=1", "--set", "max_halvings=0") == 1
    line = capfd.readouterr().err.strip().split("\n")[-1]
    assert line.startswith("pdvol: level 0, step ") and "Traceback" not in line
    run = open_run(out)
    assert run.info["state"] == "failed" and "step" in run.info["levels"][0]["reason"]
    assert run.levels[0].steps >= 1 and (out / "level_0.xdmf").exists()
    # A kinder solver goes on from there: solver settings are not part of what the scene is.
    assert pdvol("run", scene, "--out", out, "--resume") == 0
    assert open_run(out).info["state"] == "done"
    assert verify_run(out) == []


def test_a_number_that_a_function_reads_is_part_of_the_scene(tmp_path, capfd):
    """Edited after level 0, it would make level 1 another animation."""
    falls = FALL.replace("Gravity((0.0, -9.81))", "Gravity(lambda t: (0.0, -G))").replace(
        "\n\ndef scene", "\nG = 9.81\n\n\ndef scene", 1
    )
    scene, out = write(tmp_path / "fall.py", falls), tmp_path / "run"
    assert pdvol("preview", scene, "--steps", 2, "--no-picture", "--out", out) == 0
    write(scene, falls.replace("G = 9.81", "G = 1.6"))
    capfd.readouterr()
    assert pdvol("refine", out, "--to", 1) == 2
    assert "holds another scene (scene.loads[0].acceleration.reads.G: 9.81 -> 1.6)" in capfd.readouterr().err
    write(scene, falls)
    assert pdvol("refine", out, "--to", 1, "--no-picture") == 0
