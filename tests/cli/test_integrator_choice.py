"""`--set integrator=bdf2` through the command line: what it runs, stores, resumes, measures and refuses."""

import json
import shutil

import numpy as np
import pytest

from cli_scenes import FALL, pdvol, states, write
from pdvol import open_run
from pdvol.measure.verify import verify_run

STEPS = 8
BDF2 = ("--set", "integrator=bdf2")
DIRECT = ("--method", "direct", "--steps", STEPS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A direct run by each integrator."""
    folder = tmp_path_factory.mktemp("integrators")
    write(folder / "fall.py", FALL)
    for name in ("implicit_euler", "bdf2"):
        words = (*DIRECT, "--set", f"integrator={name}")
        assert pdvol("run", folder / "fall.py", *words, "--out", folder / name) == 0
    return folder


@pytest.fixture
def refuse(capfd):
    """Runs a command line that ends with exit code 2 and one line; returns that line."""

    def refuse_(*words):
        capfd.readouterr()
        assert pdvol(*words) == 2
        (line,) = capfd.readouterr().err.splitlines()
        assert line.startswith("pdvol: ")
        return line

    return refuse_


def interrupt(run, level, step):
    """Takes a run back to a state of a level."""
    info = json.loads((run / "run.json").read_text())
    for later in range(level, 2):
        info["levels"][later]["state"] = "running" if later == level else "pending"
        for file in (run / "levels" / str(later)).glob("[0-9]*.npy"):
            if later > level or int(file.stem) > step:
                file.unlink()
    lines = (run / "log.jsonl").read_bytes().splitlines(keepends=True)
    (run / "log.jsonl").write_bytes(b"".join(lines[: level * STEPS + step]))
    (run / "run.json").write_text(json.dumps({**info, "state": "running"}))


def test_it_runs_and_is_another_motion(folder):
    run, other = open_run(folder / "bdf2"), open_run(folder / "implicit_euler")
    assert run.info["description"]["integrator"] == "bdf2"
    assert verify_run(folder / "bdf2") == []
    for level, its in zip(run.levels, other.levels, strict=True):
        assert level.steps == STEPS + 1 and max(record["contacts"] for record in level.log) > 0
        np.testing.assert_array_equal(level.positions(1), its.positions(1))  # the first step is one of implicit Euler
        assert np.abs(level.positions(STEPS) - its.positions(STEPS)).max() > 1e-5


@pytest.mark.parametrize(("level", "step"), [(0, 0), (0, 1), (0, 2), (0, 5), (1, 3), (1, 4)])
def test_resumed_equals_uninterrupted(folder, tmp_path, level, step):
    out = shutil.copytree(folder / "bdf2", tmp_path / "run")
    interrupt(out, level, step)
    assert pdvol("run", folder / "fall.py", *DIRECT, *BDF2, "--out", out, "--resume") == 0
    for index in range(2):
        assert states(out, index) == states(folder / "bdf2", index)


def test_levels_side_by_side(folder, tmp_path):
    assert pdvol("run", folder / "fall.py", *DIRECT, *BDF2, "--out", tmp_path / "run", "--wavefront") == 0
    for index in range(2):
        assert states(tmp_path / "run", index) == states(folder / "bdf2", index)


@pytest.mark.parametrize("method", ["progressive", "tracks", "embedded"])
def test_methods_that_need_implicit_euler_refuse_it(folder, tmp_path, refuse, method):
    words = ("--method", method, "--set", "weight=0.1", *BDF2, "--out", tmp_path / "run")
    line = refuse("run", folder / "fall.py", *words)
    assert f"the method {method} needs integrator=implicit_euler; bdf2 goes with --method direct" in line
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("words", [("preview",), ("run", "--levels", "0"), ("run", "--set", "sizes=(2,)")])
def test_one_level_takes_it_with_any_method(folder, tmp_path, words, refuse):
    """They march level 0 alone, which is direct. A preview cannot be refined then: its method is progressive."""
    command, *more = words
    out = tmp_path / "run"
    assert pdvol(command, folder / "fall.py", *more, *BDF2, "--steps", STEPS, "--out", out) == 0
    run, whole = open_run(out), open_run(folder / "bdf2")
    np.testing.assert_array_equal(run.levels[0].positions(STEPS), whole.levels[0].positions(STEPS))
    if command == "preview":
        assert "bdf2 goes with --method direct" in refuse("refine", out, "--to", 1)


@pytest.mark.parametrize("name", ["rk4", "BDF2", "2", "[1]", "None", "()", "{}"])
def test_an_unknown_integrator(folder, tmp_path, refuse, name):
    line = refuse("run", folder / "fall.py", *DIRECT, "--set", f"integrator={name}", "--out", tmp_path / "run")
    assert "unknown integrator" in line and "choose one of implicit_euler, bdf2" in line
    assert not (tmp_path / "run").exists()


def test_a_run_stored_before_there_was_a_choice_resumes(folder, tmp_path):
    """The default leaves no trace in a run's description, so such runs are the same scene."""
    out = shutil.copytree(folder / "implicit_euler", tmp_path / "run")
    interrupt(out, 1, 4)
    info = json.loads((out / "run.json").read_text())
    assert "integrator" not in info["description"]
    (out / "run.json").write_text(json.dumps({**info, "parameters": {}}))
    assert pdvol("run", folder / "fall.py", *DIRECT, "--out", out, "--resume") == 0
    for index in range(2):
        assert states(out, index) == states(folder / "implicit_euler", index)


def test_a_run_goes_on_with_its_own_integrator_alone(folder, refuse):
    for old, new in (("implicit_euler", "bdf2"), ("bdf2", "implicit_euler")):
        words = (*DIRECT, "--set", f"integrator={new}", "--out", folder / old, "--resume")
        before = states(folder / old, 1)
        line = refuse("run", folder / "fall.py", *words)
        assert f"holds another scene (scene.integrator: {old} -> {new}); choose another folder" in line
        assert states(folder / old, 1) == before


def test_metrics_note_that_there_is_no_continuity(folder, capsys):
    """Whatever needs no x_hat is measured; masses are those of the scene."""
    measured = {}
    for name in ("implicit_euler", "bdf2"):
        assert pdvol("metrics", folder / name) == 0
        measured[name] = json.loads((folder / name / "metrics.json").read_text())
    out = capsys.readouterr().out
    assert out.count("note: no continuity: it is defined for steps of implicit Euler, and the run's are of bdf2") == 1
    assert measured["implicit_euler"]["notes"] == [] and len(measured["bdf2"]["notes"]) == 1
    for mine, its in zip(measured["bdf2"]["levels"], measured["implicit_euler"]["levels"], strict=True):
        assert set(its) - set(mine) == {"continuity", "continuity_error"}
        assert mine["mass"] == its["mass"] and len(mine["jitter"]) == STEPS


def test_masses_by_position_are_measured_with_bdf2(tmp_path):
    """The scene's densities are known, with or without a continuity: 1000 + 500 x over the unit square is 1250 kg."""
    text = FALL.replace("NeoHookean(young)", "NeoHookean(young, 0.3, lambda X: 1000.0 + 500.0 * X[:, 0])")
    scene = write(tmp_path / "dense.py", text.replace("angle=0.05", "angle=0.0"))
    assert pdvol("run", scene, "--levels", "0", "--steps", 1, *BDF2, "--out", tmp_path / "run") == 0
    assert pdvol("metrics", tmp_path / "run") == 0
    measured = json.loads((tmp_path / "run" / "metrics.json").read_text())
    assert len(measured["notes"]) == 1 and measured["levels"][0]["mass"] == pytest.approx(1250.0, rel=1e-9)


def test_info_names_an_integrator_that_is_not_the_default(folder, capsys):
    for words, named in ((BDF2, 1), ((), 0), (("--set", "integrator=implicit_euler"), 0)):
        assert pdvol("info", folder / "fall.py", *words) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines.count("integrator: bdf2, for --method direct") == named
        assert sum(line.startswith("integrator") for line in lines) == named
