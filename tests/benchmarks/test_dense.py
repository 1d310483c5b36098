"""The table of dense contact: its rows, its records and what it keeps. The old code is this one here."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.common import commits
from benchmarks.dense import __main__ as dense
from benchmarks.dense import rows as dense_rows
from benchmarks.dense import scenes as dense_scenes
from pdvol.runs.scene_file import load_shot

ROOT = Path(__file__).resolve().parents[2]
PAGE = f"# Title\n\n{dense.BEGIN}\nold\n{dense.END}\nafter\n"


def record(seconds=(9.0, 1.0, 1.0), newton=(2, 4, 6), **other):
    """A record of three steps."""
    steps = len(seconds)
    return {
        "vertices": 1200,
        "seconds": list(seconds),
        "tick": 1.0,
        "parts": dict.fromkeys(dense_rows.PARTS, 0.1),
        "newton": list(newton),
        "linear": [10] * steps,
        "contacts": [0, 5, 7],
        "reached": [1.0] * steps,
        "speed": 3.0,
        "reason": "",
        "commit": "0123456789",
        "runs": 3,
        "states": "sound",
        "apart": 1e-6,
        **other,
    }


@pytest.fixture
def tiny(monkeypatch):
    """A row of a block of eight cells, two steps, run once with each code; the old code is this one here."""
    row = dense_rows.dense("plates", "a small block", 2, {"faster": 0.1})
    row.settings["cuts"] = 2
    monkeypatch.setitem(dense_rows.ROWS, "tiny", row)
    monkeypatch.setattr(dense, "RUNS", 1)
    monkeypatch.setattr(dense.Baseline, "code", lambda self: ROOT)


class NoRepository:
    """In place of a repository that is not needed."""

    def head(self):
        return "f" * 40

    def full(self, start):
        return "0" * 40


@pytest.mark.slow
def test_old_and_new_in_turn_and_what_is_kept(tiny, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(commits, "Repository", lambda folder: NoRepository())
    page, out = tmp_path / "page.md", tmp_path / "out"
    page.write_text(PAGE)
    words = ["--scenes", "tiny", "--cache", str(tmp_path / "cache"), "--out", str(out), "--docs", str(page)]
    assert dense.main(words) == 0
    old, new = json.loads((out / "dense.json").read_text())["rows"]["tiny"]
    assert len(new["seconds"]) == len(new["newton"]) == 2 and min(new["seconds"]) > 0.0 and new["tick"] > 0.0
    assert new["vertices"] == 27 and new["states"] == "sound" and new["apart"] == 0.0 and new["newton"] == old["newton"]
    text = page.read_text()
    assert text.startswith(f"# Title\n\n{dense.BEGIN}\n") and text.endswith(f"{dense.END}\nafter\n")
    assert "a small block" in text and "\nold\n" not in text and text.count("0.1 times as fast") == 1
    assert capsys.readouterr().out.strip() in text
    # The second time the old code is not run, but its records are kept.
    runs = []
    march = dense.march
    monkeypatch.setattr(dense, "march", lambda *words, **other: runs.append(words[3]) or march(*words, **other))
    assert dense.main(words) == 0 and runs == ["f" * 40]
    assert json.loads((out / "dense.json").read_text())["rows"]["tiny"][0] == old
    assert dense.main([*words, "--again"]) == 0 and runs[1:] == ["0" * 40, "f" * 40]


def test_another_package_is_refused(tiny, tmp_path):
    found = dense.march(dense.ROWS["tiny"], 2, tmp_path, "", tmp_path, tmp_path / "end.npz")
    assert "ImportError" in found["reason"] and not found["seconds"]


@pytest.mark.parametrize(
    "words", [("--scenes", "nothing"), ("--against", "zzzz"), ("--docs", "/nonexistent"), ("--docs", __file__)]
)
def test_a_mistake_is_one_line(words, tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    code = dense.main(["--docs", str(page), "--out", str(tmp_path), "--cache", str(tmp_path), *words])
    shown = capsys.readouterr()
    assert code == 2 and shown.err.startswith("benchmarks.dense: ") and shown.err.count("\n") == 1 and not shown.out


@pytest.mark.parametrize("name", ["stack", "plates", "struck_15"])
def test_scenes_of_its_own(name):
    scene = load_shot(ROOT / "benchmarks" / "dense" / "scenes.py", {"name": name}).scene
    assert scene.steps in (20, 40, 100) and scene.contact


def test_the_balls_are_apart_at_the_start():
    scene = dense_scenes.scene("balls")
    centres = np.array([body.placement.translate for body in scene.bodies])
    distance = np.linalg.norm(centres[:, None] - centres, axis=2)[np.triu_indices(len(centres), 1)]
    walls = np.array([[wall.point, wall.normal] for wall in scene.obstacles])
    assert len(centres) == 27 and distance.min() > 0.2
    assert all(((centres - point) @ normal).min() > 0.1 for point, normal in walls)


def test_times_leave_out_the_first_step():
    assert dense_rows.pace(record()) == 1.0 and dense_rows.pace(record(seconds=[9.0])) == 9.0
    assert dense_rows.faster(record(seconds=[1.0, 4.0, 4.0]), record()) == 4.0
    assert dense_rows.faster(record(seconds=[1.0, 3.0]), record(seconds=[1.0, 1.0, 7.0])) == 3.0


def test_the_median_run_counts_and_a_failed_one_more():
    runs = [record(seconds=[1.0, s, s]) for s in (3.0, 1.0, 2.0)]
    assert dense.median(runs) == {**runs[2], "runs": 3, "paces": [3.0, 1.0, 2.0]}
    assert dense.median([*runs, bad := record(reason="no")])["reason"] == bad["reason"]
    assert dense.wanted([]) and dense.wanted(runs[:2]) and not dense.wanted(runs)
    assert not dense.wanted([record(seconds=[100.0])]) and not dense.wanted([bad])


def test_states_of_other_meshes_or_steps_are_not_compared(tmp_path):
    rest = np.zeros((3, 3))
    for name, (last, step) in {"a": (0.0, 5), "b": (0.5, 5), "c": (0.5, 6)}.items():
        np.savez(tmp_path / f"{name}.npz", rest=rest, last=rest + [last, 0, 0], step=step, diagonal=2.0)
    path = lambda name: tmp_path / f"{name}.npz"
    assert dense.apart(path("a"), path("b")) == 0.25
    assert dense.apart(path("a"), path("c")) is None and dense.apart(path("a"), path("none")) is None
