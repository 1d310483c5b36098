"""`pdvol study` and what takes settings from it, through the command line."""

import json
import shutil
import signal
import subprocess
import time
from contextlib import closing

import numpy as np
import pytest

from browser import busy
from cli_scenes import FALL, pdvol, write
from commands import PDVOL, SAFETY
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
    reference = open_run(folder / "s" / "runs" / "dt-0.005")
    states = ReferenceStates(reference, 1)
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
    front = sorted((p["cost"]["cpu"], p["errors"]["end"]) for p in study["points"] if p["front"])
    assert front and all(b[1] < a[1] for a, b in zip(front, front[1:], strict=False))


def test_a_run_that_fails_is_a_failed_point_and_not_the_end(folder):
    failed = [run for run in studied(folder)["runs"] if run["state"] != "done"]
    assert [run["run"] for run in failed] == ["max_iterations-1"] and "level 0" in failed[0]["reason"]
    page = (folder / "s" / "study.html").read_text()
    assert "max_iterations-1: failed" in page and page.count("<svg") >= 2 and "http" not in page.split("<svg")[0]


ONE_LINE = """cell => {
  const range = document.createRange();
  range.selectNodeContents(cell);
  return new Set([...range.getClientRects()].map((box) => Math.round(box.top))).size <= 1;
}"""
"""Whether what a cell or a word holds is on one line."""


def test_the_page_opens_from_a_disk_and_shows_its_plots_and_table(folder, tab):
    tab.page.set_viewport_size({"width": 1200, "height": 800})
    tab.open(folder / "s" / "study.html")
    plots = tab.page.locator("svg")
    assert plots.count() >= 2
    for plot in plots.all():
        box = plot.bounding_box()
        assert box["width"] > 200 and box["height"] > 150
    for number in range(plots.count()):
        assert busy(tab.picture(f"svg >> nth={number}")) > 0.01
    assert tab.page.locator("table tr").count() == len(studied(folder)["points"]) + 1
    assert tab.page.evaluate(f"[...document.querySelectorAll('td:not(:first-child), .option')].every({ONE_LINE})")
    said = tab.page.inner_text("body")
    assert "`" not in said and all(s.replace("`", "") in said for s in studied(folder)["sentences"])
    assert tab.complaints == [] and tab.requests == []


def test_the_time_step_s_order_is_fitted_and_the_reference_has_an_error(folder):
    study = studied(folder)
    (order,) = [entry for entry in study["orders"] if entry["axis"] == "dt"]
    assert order["finest"] == 0.01 and [value for value, _ in order["values"]] == [0.02, 0.04]
    assert study["reference"]["run"] == "dt-0.005" and study["reference"]["parts"]["dt"] > 0.0
    assert study["spread"]["runs"] == 3 and study["spread"]["growth"] > 0.0


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
        (("--accuracy", "5", "--study", "STUDY"), "write a number and its unit"),
        (("--accuracy", "0mm", "--study", "STUDY"), "write a number and its unit"),
        (("--time", "5mm", "--study", "STUDY"), "write a number and its unit"),
        (("--time", "5s", "--accuracy", "1%", "--study", "STUDY"), "one of them"),
        (("--study", "STUDY"), "one of them"),
        (("--time", "5s", "--set", "mu=0.1", "--study", "STUDY"), "study of another scene"),
    ],
)
def test_what_cannot_be_chosen_is_said_in_one_line(folder, tmp_path, capsys, words, message):
    write(folder / "six.py", FALL.replace("steps=10", "steps=6"))
    words = [folder / "s" if word == "STUDY" else word for word in words]
    assert pdvol("run", folder / "six.py", *words, "--out", tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and not (tmp_path / "out").exists()


def test_another_scene_is_refused(folder, tmp_path, capsys):
    write(tmp_path / "fall.py", FALL.replace("mu=0.3", "mu=0.4"))
    assert pdvol("study", tmp_path / "fall.py", "-o", folder / "s", *WORDS) == 2
    assert "another scene" in capsys.readouterr().err


@pytest.mark.slow
def test_a_killed_study_goes_on_and_gives_the_same_points(folder, tmp_path):
    shutil.copy(folder / "fall.py", tmp_path / "fall.py")
    words = [*PDVOL, "study", tmp_path / "fall.py", "-o", tmp_path / "s", *map(str, WORDS)]
    with subprocess.Popen(words, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + SAFETY
        while not (tmp_path / "s" / "runs" / "dt-0.04" / "run.json").exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "s").glob("runs/default/levels/*/states.bin")}
    assert kept
    assert pdvol("study", tmp_path / "fall.py", "-o", tmp_path / "s", *WORDS) == 0
    assert all(path.stat().st_mtime_ns == time for path, time in kept.items()), "finished runs are not made again"
    mine, before = ({(p["run"], p["level"]): p["errors"] for p in studied(f)["points"]} for f in (tmp_path, folder))
    assert mine.keys() >= {key for key in before if "_" not in key[0]}
    for key in mine.keys() & before.keys():
        assert mine[key] == before[key]
