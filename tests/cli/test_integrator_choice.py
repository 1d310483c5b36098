"""`--set integrator=bdf2` through the command line: what it runs, stores, resumes, measures and refuses."""

import json
import shutil

import numpy as np
import pytest

import runs
from cli_scenes import FALL, pdvol, states, write
from pdvol import open_run
from pdvol.measure.verify import verify_run
from pdvol.registry import METHODS

STEPS = 8
BDF2 = ("--set", "integrator=bdf2")
DIRECT = ("--method", "direct", "--steps", STEPS)


def by(method):
    """The words of a run by a method; tracks needs its weight."""
    return ("--method", method, "--steps", STEPS, *(("--set", "weight=0.1") if method == "tracks" else ()))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A direct run by each integrator, and one by BDF2 of each other method, all of it on two levels."""
    folder = tmp_path_factory.mktemp("integrators")
    write(folder / "fall.py", FALL)
    names = {method: method for method in METHODS} | {"direct": "bdf2"}
    for method, name in names.items():
        assert pdvol("run", folder / "fall.py", *by(method), *BDF2, "--out", folder / name) == 0
    euler = ("--set", "integrator=implicit_euler")
    assert pdvol("run", folder / "fall.py", *DIRECT, *euler, "--out", folder / "implicit_euler") == 0
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
        runs.keep_states(run / "levels" / str(later), step + 1 if later == level else 0)
    lines = (run / "log.jsonl").read_bytes().splitlines(keepends=True)
    (run / "log.jsonl").write_bytes(b"".join(lines[: level * STEPS + step]))
    (run / "run.json").write_text(json.dumps({**info, "state": "running"}))


def test_it_runs_with_every_method(folder):
    """Each finer level is a motion of its own, in contact; embedded ones repeat level 0."""
    ends = {name: open_run(folder / name).levels[1].positions(STEPS) for name in (*METHODS, "bdf2") if name != "direct"}
    for name, end in ends.items():
        others = [np.abs(end - other).max() for its, other in ends.items() if its != name]
        assert min(others) > 1e-5
        if name != "embedded":
            assert verify_run(folder / name) == []


def test_it_runs_and_is_another_motion(folder):
    run, other = open_run(folder / "bdf2"), open_run(folder / "implicit_euler")
    assert run.info["description"]["integrator"] == "bdf2"
    assert verify_run(folder / "bdf2") == []
    for level, its in zip(run.levels, other.levels, strict=True):
        assert level.steps == STEPS + 1 and max(record["contacts"] for record in level.log) > 0
        np.testing.assert_array_equal(level.positions(1), its.positions(1))  # the first step is one of implicit Euler
        assert np.abs(level.positions(STEPS) - its.positions(STEPS)).max() > 1e-5


@pytest.mark.parametrize(
    ("name", "level", "step"),
    [
        ("bdf2", 0, 0),
        ("bdf2", 0, 1),
        ("bdf2", 0, 2),
        ("bdf2", 0, 5),
        ("bdf2", 1, 3),
        ("bdf2", 1, 4),
        ("progressive", 1, 1),
        ("progressive", 1, 5),
        ("tracks", 1, 4),
        ("embedded", 1, 4),
    ],
)
def test_resumed_equals_uninterrupted(folder, tmp_path, name, level, step):
    out = shutil.copytree(folder / name, tmp_path / "run")
    interrupt(out, level, step)
    method = "direct" if name == "bdf2" else name
    assert pdvol("run", folder / "fall.py", *by(method), *BDF2, "--out", out, "--resume") == 0
    for index in range(2):
        assert states(out, index) == states(folder / name, index)


@pytest.mark.parametrize(("method", "name"), [("direct", "bdf2"), ("progressive", "progressive")])
def test_levels_side_by_side(folder, tmp_path, method, name):
    assert pdvol("run", folder / "fall.py", *by(method), *BDF2, "--out", tmp_path / "run", "--wavefront") == 0
    for index in range(2):
        assert states(tmp_path / "run", index) == states(folder / name, index)


def test_a_preview_is_refined_by_it(folder, tmp_path):
    """Level 0 is direct with any method, and the preview's method is progressive."""
    out = tmp_path / "run"
    assert pdvol("preview", folder / "fall.py", *BDF2, "--steps", STEPS, "--out", out) == 0
    assert pdvol("refine", out, "--to", 1) == 0
    assert states(out, 0) == states(folder / "bdf2", 0) == states(folder / "progressive", 0)
    assert states(out, 1) == states(folder / "progressive", 1) != states(folder / "bdf2", 1)


@pytest.mark.parametrize("name", ["rk4", "BDF2", "2", "[1]", "None", "()", "{}"])
def test_an_unknown_integrator(folder, tmp_path, refuse, name):
    line = refuse("run", folder / "fall.py", *DIRECT, "--set", f"integrator={name}", "--out", tmp_path / "run")
    assert "unknown integrator" in line and "choose one of bdf2, implicit_euler" in line
    assert not (tmp_path / "run").exists()


def test_a_run_stored_before_there_was_a_choice_resumes(folder, tmp_path):
    """What was the only choice leaves no trace in a run's description, so such runs are the same scene."""
    out = shutil.copytree(folder / "implicit_euler", tmp_path / "run")
    interrupt(out, 1, 4)
    info = json.loads((out / "run.json").read_text())
    assert "integrator" not in info["description"]
    (out / "run.json").write_text(json.dumps({**info, "parameters": {}}))
    euler = ("--set", "integrator=implicit_euler")
    assert pdvol("run", folder / "fall.py", *DIRECT, *euler, "--out", out, "--resume") == 0
    for index in range(2):
        assert states(out, index) == states(folder / "implicit_euler", index)


def test_a_run_goes_on_with_its_own_integrator_alone(folder, refuse):
    for old, new in (("implicit_euler", "bdf2"), ("bdf2", "implicit_euler")):
        words = (*DIRECT, "--set", f"integrator={new}", "--out", folder / old, "--resume")
        before = states(folder / old, 1)
        line = refuse("run", folder / "fall.py", *words)
        assert f"holds another scene (scene.integrator: {old} -> {new}); choose another folder" in line
        assert states(folder / old, 1) == before


@pytest.mark.parametrize("name", ["implicit_euler", "bdf2", "progressive"])
def test_continuity_is_that_of_the_integrator_s_own_equation(folder, name):
    """A quarter on levels that go by their own states, to the round-off of what the solver leaves: residuals of the
    tolerance times dt, 1e-6 m, beside positions of 1 m. Finer levels of another method have no such value.
    """
    assert pdvol("metrics", folder / name) == 0
    measured = json.loads((folder / name / "metrics.json").read_text())
    assert measured["notes"] == []
    own, fine = (np.array(level["continuity"]) for level in measured["levels"])
    np.testing.assert_allclose(own, 0.25, rtol=1e-6)
    if name == "progressive":
        assert (np.abs(fine - 0.25) > 0.1).any()
    else:
        np.testing.assert_allclose(fine, 0.25, rtol=1e-6)


def test_info_names_an_integrator_that_is_not_the_default(folder, capsys):
    for words, named in (((), 0), (BDF2, 0), (("--set", "integrator=implicit_euler"), 1)):
        assert pdvol("info", folder / "fall.py", *words) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines.count("integrator: implicit_euler") == named
        assert sum(line.startswith("integrator") for line in lines) == named
