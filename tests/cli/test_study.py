"""`pdvol study` and what takes settings from it, through the command line."""

import json
from contextlib import closing

import numpy as np
import pytest

from browser import busy
from cli_scenes import FALL, pdvol, write
from pdvol.store.reader import open_run
from pdvol.studio.study import study
from pdvol.studio.study.reference import ReferenceStates
from pdvol.studio.workers import Workers

VARIED = ("--vary", "dt=0.04,0.01", "--vary", "level", "--vary", "max_iterations=1:200")
WORDS = ("--steps", 6, *VARIED, "--budget", 3, "--reference", "dt=0.005")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study of the falling square, by a worker that stays; one of its variations cannot converge."""
    folder = tmp_path_factory.mktemp("study")
    write(folder / "fall.py", FALL)
    with pytest.MonkeyPatch.context() as patch, closing(Workers(1)) as worker:
        patch.setattr(study, "Workers", lambda jobs, fresh: worker)
        assert pdvol("study", folder / "fall.py", "-o", folder / "s", *WORDS) == 0
    return folder


def studied(folder):
    return json.loads((folder / "s" / "study.json").read_text())


def test_points_have_costs_and_errors_that_the_runs_confirm(folder):
    study = studied(folder)
    assert [level["vertices"] for level in study["levels"]] == [9, 25]
    states = ReferenceStates(open_run(folder / "s" / "runs" / "dt-0.005"), 1)
    assert {(p["run"], p["level"]) for p in study["points"]} >= {
        *((run, level) for run in ("default", "direct", "dt-0.04", "dt-0.01") for level in (0, 1)),
        ("dt-0.005", 0),
    }
    for point in study["points"]:
        run = open_run(folder / "s" / "runs" / point["run"])
        again = states.errors(run, point["level"])
        assert again["end"] == point["errors"]["end"] > 0.0 and again["worst"] >= again["end"]
        alone = point["method"] == "direct"
        log = [r for level in run.levels for r in level.log if level.index == point["level"] or not alone]
        log = [r for r in log if r["level"] <= point["level"]]
        assert point["cost"]["newton"] == sum(r["newton_iterations"] for r in log)
        assert 0.0 < point["cost"]["cpu"] == pytest.approx(sum(r["seconds"]["cpu"] for r in log))
    (second,) = [p["errors"]["end"] for p in study["points"] if (p["run"], p["level"]) == ("dt-0.01", 1)]
    part = study["reference"]["parts"]["dt"]
    assert part == pytest.approx(second / (2.0 ** (2.0 / 3.0) - 1.0)), "below first order: impacts make waves"
    (order,) = [entry for entry in study["orders"] if entry["axis"] == "dt"]
    assert order["finest"] == 0.01 and [value for value, _ in order["values"]] == [0.02, 0.04]
    assert study["reference"]["run"] == "dt-0.005" and part > 0.0
    assert study["spread"]["runs"] == 3 and study["spread"]["growth"] > 0.0
    front = sorted((p["cost"]["cpu"], p["errors"]["end"]) for p in study["points"] if p["front"])
    assert front and all(b[1] < a[1] for a, b in zip(front, front[1:], strict=False))


def test_the_page_shows_plots_and_a_table_and_names_what_failed(folder, tab):
    found = studied(folder)
    (failed,) = [run for run in found["runs"] if run["state"] != "done"]
    assert failed["run"] == "max_iterations-1" and "level 0" in failed["reason"]
    text = (folder / "s" / "study.html").read_text()
    assert "max_iterations-1: failed" in text and text.count("<svg") >= 2 and "http" not in text.split("<svg")[0]
    tab.open(folder / "s" / "study.html")
    for number in range(tab.page.locator("svg").count()):
        assert busy(tab.picture(f"svg >> nth={number}")) > 0.01
    assert tab.page.locator("table tr").count() == len(found["points"]) + 1
    said = tab.page.inner_text("body")
    assert "`" not in said and all(s.replace("`", "") in said for s in found["sentences"])
    assert tab.complaints == [] and tab.requests == []


def test_a_run_takes_the_settings_found_for_an_accuracy_or_a_time(folder, capsys):
    study = studied(folder)
    best = min(study["points"], key=lambda p: p["errors"]["end"])
    asked = 1000.0 * (best["errors"]["end"] + study["reference"]["error"]) * 1.0001
    words = ("--steps", 6, "--study", folder / "s", "--accuracy", "5mm")
    code = pdvol("run", folder / "fall.py", *words, "--out", folder / "no")
    assert code == 2 and "--levels and --steps come from the study" in capsys.readouterr().err
    write(folder / "six.py", FALL.replace("steps=10", "steps=6"))
    scene = folder / "six.py"
    options = ("--study", folder / "s", "--no-picture")
    assert pdvol("run", scene, *options, "--accuracy", f"{asked:.6f}mm", "--out", folder / "exact") == 0
    states = ReferenceStates(open_run(folder / "s" / "runs" / "dt-0.005"), 1)
    run = open_run(folder / "exact")
    finest = max(level.index for level in run.levels if level.steps)
    assert states.errors(run, finest)["end"] * 1000.0 <= asked
    assert pdvol("run", scene, *options, "--accuracy", "1e-6mm", "--out", folder / "reference") == 0
    assert "whose own error is about" in capsys.readouterr().err
    np.testing.assert_array_equal(
        open_run(folder / "reference").levels[1].positions(24),
        open_run(folder / "s" / "runs" / "dt-0.005").levels[1].positions(24),
    )
    cheapest = min(study["points"], key=lambda p: p["cost"]["cpu"])
    assert pdvol("run", scene, *options, "--time", "1h", "--out", folder / "hour") == 0
    seconds = f"{cheapest['cost']['cpu'] * 0.5}s"
    assert pdvol("run", scene, *options, "--time", seconds, "--out", folder / "none") == 2
    assert "the cheapest settings" in capsys.readouterr().err and not (folder / "none").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--accuracy", "5"), "write a number and its unit"),
        (("--time", "5mm"), "write a number and its unit"),
        (("--time", "5s", "--accuracy", "1%"), "one of them"),
        ((), "one of them"),
        (("--time", "5s", "--set", "mu=0.1"), "study of another scene"),
    ],
)
def test_what_cannot_be_chosen_is_said_in_one_line(folder, tmp_path, capsys, words, message):
    write(folder / "six.py", FALL.replace("steps=10", "steps=6"))
    assert pdvol("run", folder / "six.py", *words, "--study", folder / "s", "--out", tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and not (tmp_path / "out").exists()


def test_a_study_goes_on_with_its_runs_and_not_with_another_scene(folder, tmp_path, capsys):
    kept = {path: path.stat().st_mtime_ns for path in (folder / "s").glob("runs/*/levels/*/states.bin")}
    assert kept and pdvol("study", folder / "fall.py", "-o", folder / "s", *WORDS) == 0
    assert {path: path.stat().st_mtime_ns for path in kept} == kept, "finished runs are not made again"
    write(tmp_path / "fall.py", FALL.replace("mu=0.3", "mu=0.4"))
    assert pdvol("study", tmp_path / "fall.py", "-o", folder / "s", *WORDS) == 2
    assert "another scene" in capsys.readouterr().err
