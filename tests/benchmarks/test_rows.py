"""Studies that march rows (dense, elements, ranks, stark) in a short form, and the figures of their records."""

import importlib
import json
import sys
import types
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.common import commits, march
from benchmarks.common import rows as common_rows
from benchmarks.common.process import REPOSITORY, Mistake
from benchmarks.common.scenes import piles
from benchmarks.dense import __main__ as dense
from benchmarks.elements import __main__ as elements
from benchmarks.elements import frequencies
from benchmarks.ranks import __main__ as ranks
from benchmarks.stark import __main__ as stark
from benchmarks.stark import shot
from pdvol import NeoHookean, Plane, Rotation, Support, Translation
from pdvol.runs.scene_file import load_shot

PILES = REPOSITORY / "benchmarks" / "common" / "scenes" / "piles.py"


def page_of(study, what="tables"):
    """A page that keeps a study's tables."""
    return f"# Title\n\n<!-- benchmarks.{study}: {what} -->\nold\n<!-- benchmarks.{study}: end -->\nafter\n"


def record(seconds=(9.0, 1.0, 1.0), **other):
    """A record of three steps."""
    return {"seconds": list(seconds), "newton": [2, 4, 6], "tick": 1.0, "vertices": 1200, "reason": "", **other}


@pytest.fixture
def tiny(monkeypatch):
    """A row of two cubes of eight vertices, two steps."""
    row = common_rows.pile("stack", 2, "two cubes")
    row = replace(row, settings={**row.settings, "count": 2, "cuts": 1})
    monkeypatch.setitem(common_rows.ROWS, "tiny", row)
    return row


# ---- figures


def test_times_are_medians_over_ticks_without_the_first_step():
    theirs = [record((9.0, 4.0, 6.0), tick=2.0), record((1.0, 40.0, 40.0)), record((1.0, 3.0, 3.0))]
    ours = [record(), record((5.0, 2.0, 2.0), tick=2.0), record((5.0, 0.5, 0.5))]
    assert march.ratios([theirs, ours]) == (3.0, [2.5, 40.0, 6.0])
    assert march.pace(record([9.0])) == 9.0
    assert march.ratios([[record([1.0, 3.0])], [record([1.0, 1.0, 7.0])]])[0] == 3.0, "of steps that both have done"


def test_cut_steps_count_as_the_time_that_they_cover():
    assert march.pace(record((9.0, 1.0, 1.0, 1.0), dt=[0.01, 0.01, 0.005, 0.005])) == pytest.approx(1.5)


def test_a_failed_run_ends_its_side_and_is_a_row_with_its_reason():
    found = march.in_turn({"old": lambda: record(), "new": lambda: record(reason="no")}, 2)
    assert [len(some) for some in found.values()] == [2, 1]
    assert march.versus("title", found)[3] == "new: no"
    assert len(march.in_turn({"long": lambda: record([100.0])})["long"]) == 1


def test_states_of_other_meshes_or_steps_are_not_compared():
    rest = np.zeros((3, 3))
    state = lambda last, step: {"rest": rest, "last": rest + [last, 0, 0], "step": step}
    np.testing.assert_allclose(march.distances(state(0.0, 5), state(0.5, 5)), 0.5)
    assert march.distances(state(0.0, 5), state(0.5, 6)) is None


def test_another_package_is_refused(tiny, tmp_path):
    found = march.march(tiny, tmp_path / "run", 2, tmp_path)
    assert "ImportError" in found["reason"] and not found["seconds"]


def test_the_balls_are_apart_at_the_start():
    scene = piles.scene("balls")
    centres = np.array([body.placement.translate for body in scene.bodies])
    distance = np.linalg.norm(centres[:, None] - centres, axis=2)[np.triu_indices(len(centres), 1)]
    walls = np.array([[wall.point, wall.normal] for wall in scene.obstacles])
    assert len(centres) == 27 and distance.min() > 0.2
    assert all(((centres - point) @ normal).min() > 0.1 for point, normal in walls)


# ---- commands


def test_dense_in_turn_and_what_is_kept(tiny, monkeypatch, tmp_path, capsys):
    """The old code is this one here."""
    repository = types.SimpleNamespace(head=lambda: "f" * 40, full=lambda start: "0" * 40)
    monkeypatch.setattr(commits, "Repository", lambda folder: repository)
    monkeypatch.setattr(march.in_turn, "__defaults__", (1,))
    monkeypatch.setattr(dense, "code_of", lambda *words: REPOSITORY)
    page, out = tmp_path / "page.md", tmp_path / "out"
    page.write_text(page_of("dense"))
    assert dense.main(["--scenes", "tiny", "--out", str(out), "--docs", str(page)]) == 0
    kept = json.loads((out / "dense.json").read_text())["rows"]["tiny"]
    (old,), (new,) = kept["old"], kept["new"]
    assert len(new["seconds"]) == 2 and new["newton"] == old["newton"] and new["vertices"] == 16 and new["tick"] > 0.0
    assert kept["apart"] == 0.0 and kept["states"] == "sound"
    text = page.read_text()
    assert text.startswith("# Title\n\n<!--") and text.endswith("-->\nafter\n") and "\nold\n" not in text
    assert "| two cubes | 16 | 2 (1) |" in text and capsys.readouterr().out.strip() in text


def test_ranks_in_turn(tiny, capsys):
    assert ranks.main(["--rows", "tiny", "--ranks", "1", "2", "--runs", "1"]) == 0
    lines = [line.split(" | ") for line in capsys.readouterr().out.splitlines() if line.startswith("| two cubes")]
    assert [line[1:3] for line in lines] == [["16", "1"], ["16", "2"]] and lines[0][4] == "1.00"


def test_elements_in_turn(tiny):
    assert elements.in_turn("tiny", 2, 1)[:3] == ["two cubes", "16", "2 (1)"]


def test_a_bar_of_two_cells():
    """Bending and torsion, squared frequencies: linear elements more than twice the truth, smoothed ones near it."""
    (row,) = frequencies.bars((2,))
    assert min(row["linear"]) > 2.0
    assert 1.0 < row["smoothed"][0] < 1.15 and 1.0 < row["smoothed"][1] < 1.25
    assert 1.5 < row["blocks smoothed"] / row["blocks linear"] < 3.0


@pytest.fixture
def words(tmp_path):
    """A command line of stark without mistakes, but for the folder of STARK."""
    (tmp_path / "page.md").write_text(page_of("stark", "table"))
    (tmp_path / "README.md").touch()
    return ["--docs", f"{tmp_path}/page.md", "--out", f"{tmp_path}/out", "--peers", str(tmp_path), "--scenes", "tiny"]


def test_stark_in_turn_and_what_is_kept(tiny, words, monkeypatch, tmp_path):
    def by_stark(folder, aside, cache, steps):
        """In STARK's place: its time is twice a second, and all its vertices stay where they are."""
        with np.load(aside / "shot.npz") as arrays:
            rest = np.concatenate([arrays["points_0"], arrays["points_1"]])
        state = {"rest": rest, "last": rest, "cells": np.array([[0, 1, 2, 4]]), "step": steps}
        return stark.ended(record((9.0, 2.0), dt=[0.01] * 2), steps, "", state), state

    monkeypatch.setattr(stark, "check_module", lambda folder: None)
    monkeypatch.setattr(stark, "by_stark", by_stark)
    assert stark.main([*words, "--stark", str(tmp_path), "--repeats", "2"]) == 0
    kept = json.loads((tmp_path / "out" / "stark.json").read_text())["rows"]["tiny"]
    # 16 vertices in two cubes that have fallen by less than g t^2 in two steps, in the order of what STARK was given
    assert kept["pdvol"][0]["inverted"] == 0 and 0.0 < kept["apart"][1] < 9.81 * 0.02**2
    text = (tmp_path / "page.md").read_text()
    assert "| two cubes | 16 | 2 (2) |" in text and "\nold\n" not in text and text.endswith("-->\nafter\n")


def test_a_run_of_stark_that_fails_is_a_row_with_its_reason(tiny, words, tmp_path):
    (tmp_path / "pystark").mkdir()
    (tmp_path / "pystark" / "__init__.py").write_text("class Settings: pass\n")
    assert stark.main([*words, "--stark", str(tmp_path), "--repeats", "1"]) == 1
    assert "stark: AttributeError: module 'pystark' has no attribute" in (tmp_path / "page.md").read_text()


class Marching:
    """In place of a simulation of STARK: the second solve fails, and the third step is half as long."""

    def __init__(self):
        self.time, self.solved, self.sizes = 0.0, [], iter((0.01, 0.0, 0.01, 0.005, 0.005))

    def get_time(self):
        return self.time

    def get_time_step_size(self):
        return 0.01

    def run_one_time_step(self):
        self.time += next(self.sizes)
        self.solved.append(2)

    def logger(self):
        return self

    def get_int_series(self, name):
        return list(self.solved)


def test_failed_solves_and_cut_steps_of_stark(monkeypatch):
    monkeypatch.setitem(sys.modules, "pystark", types.ModuleType("pystark"))
    one = importlib.import_module("benchmarks.stark.run_one")
    turned = []
    turn = types.SimpleNamespace(set_transformation=lambda *words: turned.append(words))
    scene = {"dt": 0.01, "steps": 3, "turns": [{"speed": np.pi, "axis": [1.0, 0.0, 0.0]}], "surfaces": []}
    timer = one.Timer(1e9)
    found = one.march(Marching(), scene, [turn], timer)
    assert found["newton"] == [2, 4, 2, 2] and found["dt"] == pytest.approx([0.01, 0.01, 0.005, 0.005])
    assert len(timer.ticks) == len(found["seconds"]) == 4 and min(found["seconds"]) >= 0.0
    assert [degrees for _, degrees, _ in turned] == pytest.approx([1.8, 3.6, 3.6, 5.4, 6.3])


# ---- what STARK is given


def given(name, path):
    """The parts of the file of a scene, and the scene."""
    scene = load_shot(PILES, {"name": name}).scene
    shot.write(scene, path)
    with np.load(path) as arrays:
        parts = {key: arrays[key] for key in arrays if key != "scene"}
        return json.loads(str(arrays["scene"])), parts, scene


def test_what_stark_is_given_of_a_heap_and_of_rollers(tmp_path):
    found, arrays, scene = given("balls", tmp_path / "shot.npz")
    assert len(found["bodies"]) == 27 and len(found["planes"]) == 5 and found["turns"] == []
    assert found["bodies"][26] == {"young": 2e5, "poisson": 0.4, "density": 1000.0, "velocity": [0.0, -2.0, 0.0]}
    assert (found["dt"], found["steps"], found["gravity"]) == (0.01, 80, [0.0, -9.81, 0.0])
    assert (found["mu"], found["dhat"], found["eps_v"], found["tolerance"]) == (0.3, 1e-3, 1e-3, 1e-3)
    body = scene.bodies[5]
    assert np.allclose(arrays["points_5"].mean(axis=0), body.shape[0].vertices.mean(axis=0) + body.placement.translate)
    found, arrays, _ = given("rollers", tmp_path / "shot.npz")
    assert [one["speed"] for one in found["surfaces"]] == pytest.approx([-1.6 * np.pi, 1.6 * np.pi])
    for k, one in enumerate(found["surfaces"]):
        off = (arrays[f"surface_{k}"] - one["centre"])[:, :2]
        assert np.linalg.norm(off, axis=1).max() == pytest.approx(0.16)


@pytest.mark.parametrize(
    "change",
    [
        {"contact": (), "obstacles": ()},
        {"integrator": "bdf2"},
        {"obstacles": (Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), motion=Translation((0.0, 1.0, 0.0))),)},
        {"supports": (Support(lambda X: X[:, 0] < 0, body="cube 0", motion=Rotation(1.0, (0.0, 0.0, 0.0))),)},
    ],
)
def test_a_scene_that_stark_cannot_be_given_is_refused(change, tmp_path):
    scene = replace(load_shot(PILES, {"name": "stack"}).scene, **change)
    with pytest.raises(Mistake, match="STARK is not given"):
        shot.write(scene, tmp_path / "shot.npz")
    damped = replace(scene.bodies[0], material=NeoHookean(2e5, damping=0.1))
    with pytest.raises(Mistake, match="damping"):
        shot.write(replace(scene, bodies=(damped,)), tmp_path / "shot.npz")


# ---- mistakes


@pytest.mark.parametrize(
    "study, more, said",
    [
        (stark, (), "--stark DIR is missing"),
        (stark, ("--stark", "/nonexistent"), "has no pystark/__init__.py"),
        (stark, ("--scenes", "nothing"), "there is no 'nothing'"),
        (stark, ("--repeats", "0"), "--repeats needs"),
        (stark, ("--steps", "1"), "--steps one from 2 on"),
        (stark, ("--peers", "/nonexistent"), "name the folder of the peers' meshes"),
        (stark, ("--docs", __file__), "once each"),
        (stark, ("--docs", "/nonexistent"), "No such file"),
        (dense, ("--scenes", "nothing"), "there is no 'nothing'"),
        (dense, ("--against", "zzzz"), "zzzz"),
        (dense, ("--docs", __file__), "once each"),
        (elements, ("--rows", "nothing"), "there is no 'nothing'"),
        (elements, ("--docs", __file__), "once each"),
        (ranks, ("--rows", "nothing"), "there is no 'nothing'"),
    ],
)
def test_a_mistake_is_one_line(study, more, said, tiny, words, tmp_path, capsys):
    name = study.__name__.split(".")[1]
    own = {"stark": words, "dense": ["--out", str(tmp_path)]}.get(name, [])
    code = study.main([*own, *more])
    shown = capsys.readouterr()
    assert code == 2 and shown.err.startswith(f"benchmarks.{name}: ") and shown.err.count("\n") == 1 and not shown.out
    assert said in shown.err
