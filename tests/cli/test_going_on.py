"""A run that is resumed, refined, side by side or on two ranks equals an uninterrupted one, by any method and scene."""

import json
import shutil

import numpy as np
import pytest

import runs
from cli_scenes import FALL, pdvol, pdvol_on_ranks, states, write
from on_ranks import results_on
from pdvol import open_run
from pdvol.measure.verify import verify_run
from pdvol.registry import INTERPOLANTS, METHODS
from pdvol.runs.run_summary import event_lines
from variants import FALLING, STEPS, VARIANTS


def interrupt(out, level, step):
    """What a kill leaves: states up to a step of a level, nothing after, and a log one line ahead or torn."""
    info = json.loads((out / "run.json").read_text())
    for later in range(level, 2):
        info["levels"][later]["state"] = "running" if later == level else "pending"
        runs.keep_states(out / "levels" / str(later), step + 1 if later == level else 0)
    (out / "run.json").write_text(json.dumps({**info, "state": "running"}))
    lines = (out / "log.jsonl").read_bytes().splitlines(keepends=True)
    kept = level * info["steps"] + step
    (out / "log.jsonl").write_bytes(b"".join(lines[:kept]) + (lines[kept][:40] if kept < len(lines) else b""))


def test_every_method_and_prolongation_is_here():
    assert set(METHODS) | set(INTERPOLANTS) - {"barycentric"} <= set(VARIANTS) | {"phong"}


@pytest.mark.parametrize("name", VARIANTS)
def test_runs_are_sound(made, name):
    """Falling bodies have the same level 0 by all methods and prolongations, and another level 1."""
    run = open_run(made(name))
    for level in run.levels:
        assert level.steps == run.info["steps"] + 1
        assert max(record["contacts"] for record in level.log) > 0 or name in ("embedded", "bent")
        broken = len(level.log[-1].get("terms", {}).get("attachment", {}).get("broken", ()))
        assert (f"level {level.index}: {broken} springs of" in "\n".join(event_lines(run))) == (name == "terms")
    if name != "embedded":
        assert verify_run(run.path) == []
    for other in set(FALLING) - {name} if name in FALLING else ():
        ends = [[each.levels[k].positions(STEPS) for k in (0, 1)] for each in (run, open_run(made(other)))]
        assert np.array_equal(ends[0][0], ends[1][0]) == (("euler" in name) == ("euler" in other))
        assert np.abs(ends[0][1] - ends[1][1]).max() > 1e-7


@pytest.mark.parametrize(
    ("name", "level", "step"),
    [
        *(("progressive", *at) for at in ((0, 0), (0, STEPS), (1, 1))),
        *((name, 1, 4) for name in ("direct", "both_euler", "tracks", "embedded")),
        *(("bent", *at) for at in ((0, 3), (1, 0))),
        ("terms", 1, 8),
    ],
)
def test_resumed_equals_uninterrupted(made, tmp_path, name, level, step):
    out = shutil.copytree(made(name), tmp_path / "run")
    interrupt(out, level, step)
    assert made.run(name, out, "--resume") == 0
    runs.assert_same_runs(out, made(name))


@pytest.mark.parametrize("name", ["progressive", "both_euler", "embedded"])
def test_refined_equals_run_at_once(made, tmp_path, name, capfd):
    """Settings are kept, and coarser levels are not touched. Where nothing is left to do, nothing is drawn again."""
    out = tmp_path / "run"
    if name == "progressive":
        assert made.run(name, out, command="preview") == 0
    else:
        assert made.run(name, out, "--levels", "0") == 0
    times = {path: path.stat().st_mtime_ns for path in (out / "levels" / "0").iterdir()}
    for level in (1, 1, 0):
        assert pdvol("refine", out, "--to", level) == 0
        runs.assert_same_runs(out, made(name))
        times |= {out / name: (out / name).stat().st_mtime_ns for name in ("picture.png", "level_1.xdmf") if level}
    assert {path: path.stat().st_mtime_ns for path in times} == times
    assert capfd.readouterr().err.count("nothing was left to simulate") == 2


@pytest.mark.parametrize("name", ["consistency", "terms"])
def test_levels_side_by_side(made, tmp_path, name):
    """The penalty needs the coarser level one step further ahead than velocities do."""
    assert made.run(name, tmp_path / "run", "--wavefront") == 0
    runs.assert_same_runs(tmp_path / "run", made(name), logs=False)
    broken = [
        [[record["terms"].get("attachment", {}).get("broken", []) for record in level.log] for level in run.levels]
        for run in (open_run(made(name)), open_run(tmp_path / "run"))
    ]
    assert broken[0] == broken[1]
    assert name != "terms" or all(len({len(found) for found in level}) >= 3 for level in broken[0])


@pytest.mark.mpi
@pytest.mark.parametrize("name", ["biharmonic", "both_euler"])
def test_two_ranks_give_the_same(made, tmp_path, name):
    """The tolerance is tight because at a loose one round-off decides whether Newton takes one more step."""
    text, *words = VARIANTS[name]
    words = ["run", write(tmp_path / "fall.py", text), *words, "--set", "linear=direct"]
    words += ["--set", "tolerance=Relative(1e-7)", "--steps", 4, "--out"]
    (ended,) = results_on((2,), pdvol_on_ranks, *words, tmp_path / "two")
    assert ended["code"] == 0 and str(ended["said"]).count("and level_N.xdmf") == 1, ended["said"]
    assert pdvol(*words, tmp_path / "one") == 0
    for a, b in zip(open_run(tmp_path / "one").levels, open_run(tmp_path / "two").levels, strict=True):
        np.testing.assert_array_equal(a.cells, b.cells)
        assert a.steps == b.steps == 5 and max(record["contacts"] for record in b.log) > 0
        for step in range(5):
            np.testing.assert_allclose(b.positions(step), a.positions(step), rtol=0.0, atol=1e-8)
        for one, other in zip(a.log, b.log, strict=True):
            energies = [record["energy"].get("consistency", 0.0) for record in (one, other)]
            assert energies[1] == pytest.approx(energies[0], rel=1e-4, abs=1e-9)
    # Stored by two ranks, gone on with by one.
    assert pdvol(*words, tmp_path / "two", "--resume", "--ranks", 1, "--steps", 5) == 0
    assert [level.steps for level in open_run(tmp_path / "two").levels] == [6, 6]


# ---- what may change


def test_a_run_stored_before_there_was_a_choice_of_integrators_resumes(made, tmp_path):
    """What was the only choice leaves no trace in a run's description, so such runs are the same scene."""
    out = shutil.copytree(made("direct_euler"), tmp_path / "run")
    interrupt(out, 1, 4)
    info = json.loads((out / "run.json").read_text())
    assert "integrator" not in info["description"]
    (out / "run.json").write_text(json.dumps({**info, "parameters": {}}))
    assert made.run("direct_euler", out, "--resume") == 0
    assert [states(out, k) for k in (0, 1)] == [states(made("direct_euler"), k) for k in (0, 1)]


def test_levels_and_steps_are_added_later(tmp_path, scene, whole):
    out, words = tmp_path / "run", ("--set", "young=4e4", "--set", "max_halvings=3", "--out", tmp_path / "run")
    assert pdvol("run", scene, "--levels", "0", "--steps", 3, *words) == 0
    run = open_run(out)
    assert [level.steps for level in run.levels] == [4] and run.info["parameters"]["young"] == 4e4
    assert run.info["description"]["bodies"][0]["material"]["young"] == 4e4 and not (out / "level_1.xdmf").exists()
    assert not np.array_equal(run.levels[0].positions(3), open_run(whole).levels[0].positions(3))
    assert pdvol("run", scene, "--levels", "1", "--steps", 3, "--resume", *words) == 0
    assert [level.steps for level in open_run(out).levels] == [4, 4] and (out / "level_1.xdmf").exists()
    assert pdvol("run", scene, "--steps", 4, "--out", tmp_path / "longer") == 0
    assert pdvol("run", scene, "--resume", "--out", tmp_path / "longer") == 0
    assert [states(tmp_path / "longer", k) for k in (0, 1)] == [states(whole, k) for k in (0, 1)]


def test_a_direct_level_alone_needs_no_coarser_one(made, tmp_path):
    assert made.run("direct", tmp_path / "run", "--levels", "1:1", "--steps", 2) == 0
    alone, every = open_run(tmp_path / "run"), open_run(made("direct"))
    assert [level.steps for level in alone.levels] == [0, 3]
    np.testing.assert_array_equal(alone.levels[1].positions(2), every.levels[1].positions(2))


def test_other_solver_settings_leave_a_trace_and_hold_from_then_on(tmp_path, scene, capfd):
    """The folder says which steps had which; a later refine takes the last ones. A linear solver that settings name is
    the one in use.
    """
    out = tmp_path / "run"
    words = ("run", scene, "--levels", "0", "--out", out)
    assert pdvol(*words, "--steps", 2, "--set", "tolerance=0.01") == 0
    assert pdvol(*words, "--steps", 4, "--resume", "--set", "tolerance=Relative(1e-3)") == 0
    assert "solver settings from step 3 of levels 0 to 0 on: solver.tolerance: 0.01 -> " in capfd.readouterr().err
    for steps, method in ((5, "direct"), (6, "multilevel")):
        assert pdvol(*words, "--steps", steps, "--resume", "--set", f"linear={method}") == 0
    assert pdvol("refine", out, "--to", 1) == 0
    run = open_run(out)
    assert [entry["from"] for entry in run.info["solvers"]] == [[1], [3], [5], [6]]
    assert [record["linear_solver"] for record in run.levels[0].log] == 4 * ["iterative"] + ["direct", "multilevel"]
    assert {record["linear_solver"] for record in run.levels[1].log} == {"multilevel"}


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
    """One Newton iteration and no halving: it ends with code 1, level and step named, and keeps what was done. Another
    solver goes on from there: solver settings are not part of what the scene is.
    """
    out = tmp_path / "run"
    assert pdvol("run", scene, "--out", out, "--set", "max_iterations=1", "--set", "max_halvings=0") == 1
    line = capfd.readouterr().err.strip().split("\n")[-1]
    assert line.startswith("pdvol: level 0, step ") and "Traceback" not in line
    run = open_run(out)
    assert run.info["state"] == "failed" and "step" in run.info["levels"][0]["reason"]
    assert run.levels[0].steps >= 1 and (out / "level_0.xdmf").exists()
    assert pdvol("run", scene, "--out", out, "--resume") == 0
    assert open_run(out).info["state"] == "done" and verify_run(out) == []
