"""The table beside STARK: its rows, what STARK is given, what is kept, and mistakes. STARK itself is not needed."""

import importlib
import json
import sys
import types
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.common.process import REPOSITORY, Mistake
from benchmarks.peers.scenes import PEERS
from benchmarks.stark import __main__ as stark
from benchmarks.stark import rows, shot
from pdvol import NeoHookean, Plane, Rotation, Support, Translation
from pdvol.runs.scene_file import load_shot

PAGE = f"# Title\n\n{stark.BEGIN}\nold\n{stark.END}\nafter\n"


def record(seconds=(9.0, 1.0, 1.0), **other):
    """A record of three steps."""
    return {
        "seconds": list(seconds),
        "newton": [2, 4, 6],
        "dt": [0.01] * 3,
        "tick": 1.0,
        "vertices": 1200,
        "inverted": 0,
        "reason": "",
        "load": 0.5,
        "apart": [1e-3, 2e-3],
        "commit": "0123456789",
        **other,
    }


@pytest.fixture
def tiny(monkeypatch):
    """A row of two cubes of eight vertices, two steps, as a scene that both run."""
    row = rows.Row("two cubes", rows.PILES, {"name": "stack", "count": 2, "cuts": 1}, 2)
    monkeypatch.setitem(rows.ROWS, "tiny", row)


@pytest.fixture
def words(tmp_path):
    """A command line without mistakes, but for the folder of STARK."""
    (tmp_path / "page.md").write_text(PAGE)
    (tmp_path / "README.md").touch()
    return ["--docs", f"{tmp_path}/page.md", "--out", f"{tmp_path}/out", "--peers", str(tmp_path), "--scenes", "tiny"]


# ---- figures


def test_times_are_medians_over_ticks_without_the_first_step():
    theirs = [record((9.0, 4.0, 6.0), tick=2.0), record((1.0, 40.0, 40.0)), record((1.0, 3.0, 3.0))]
    ours = [record(), record((5.0, 2.0, 2.0), tick=2.0), record((5.0, 0.5, 0.5))]
    assert [rows.ticks(one) for one in theirs] == [2500.0, 40000.0, 3000.0]
    ratio, each = rows.ratios({"stark": theirs, "pdvol": ours})
    assert ratio == 3.0 and each == [2.5, 40.0, 6.0]
    assert rows.pace(record([9.0], dt=[0.01])) == 9.0


def test_cut_steps_count_as_the_time_that_they_cover():
    cut = record((9.0, 1.0, 1.0, 1.0), dt=[0.01, 0.01, 0.005, 0.005], newton=[2, 2, 3, 5])
    assert rows.pace(cut) == pytest.approx(1.5) and rows.per_step(cut, "newton") == pytest.approx(4.0)


# ---- what STARK is given


def given(scene, path):
    """The parts of the file of a scene."""
    shot.write(scene, path)
    with np.load(path) as arrays:
        return json.loads(str(arrays["scene"])), {name: arrays[name] for name in arrays if name != "scene"}


def test_what_stark_is_given_of_a_heap(tmp_path):
    scene = load_shot(REPOSITORY / rows.PILES, {"name": "balls"}).scene
    found, arrays = given(scene, tmp_path / "shot.npz")
    assert len(found["bodies"]) == 27 and len(found["planes"]) == 5 and found["turns"] == []
    assert found["bodies"][26] == {"young": 2e5, "poisson": 0.4, "density": 1000.0, "velocity": [0.0, -2.0, 0.0]}
    assert (found["dt"], found["steps"], found["gravity"]) == (0.01, 80, [0.0, -9.81, 0.0])
    assert (found["mu"], found["dhat"], found["eps_v"], found["tolerance"]) == (0.3, 1e-3, 1e-3, 1e-3)
    body = scene.bodies[5]
    assert np.allclose(arrays["points_5"].mean(axis=0), body.shape[0].vertices.mean(axis=0) + body.placement.translate)
    assert arrays["cells_5"].dtype == np.int32 and len(arrays) == 54


@pytest.mark.skipif(not (PEERS / "README.md").is_file(), reason="the peers' meshes are not there")
def test_what_stark_is_given_of_a_twist(tmp_path):
    scene = load_shot(REPOSITORY / rows.PEERS, {"name": "twistx_1k", "peers": str(PEERS)}).scene
    found, arrays = given(scene, tmp_path / "shot.npz")
    assert np.degrees([turn["speed"] for turn in found["turns"]]) == pytest.approx([360.0, -360.0])
    for k, end in enumerate((-0.5, 0.5)):
        assert len(arrays[f"turned_{k}"]) and np.allclose(arrays["points_0"][arrays[f"turned_{k}"], 0], end)
    assert found["mu"] == 0.0 and found["gravity"] == [0.0, 0.0, 0.0] and len(arrays["cells_0"]) == 4119


def test_what_stark_is_given_of_rollers(tmp_path):
    scene = load_shot(REPOSITORY / rows.PILES, {"name": "rollers"}).scene
    found, arrays = given(scene, tmp_path / "shot.npz")
    assert [one["speed"] for one in found["surfaces"]] == pytest.approx([-1.6 * np.pi, 1.6 * np.pi])
    for k, one in enumerate(found["surfaces"]):
        off = (arrays[f"surface_{k}"] - one["centre"])[:, :2]
        assert np.linalg.norm(off, axis=1).max() == pytest.approx(0.16) and arrays[f"faces_{k}"].shape[1] == 3
    assert found["planes"] == [] and len(arrays) == 6


FLOOR = (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    "change",
    [
        {"contact": (), "obstacles": ()},
        {"integrator": "bdf2"},
        {"obstacles": (Plane(*FLOOR, motion=Translation((0.0, 1.0, 0.0))),)},
        {"supports": (Support(lambda X: X[:, 0] < 0, body="cube 0", motion=Rotation(1.0, (0.0, 0.0, 0.0))),)},
    ],
)
def test_a_scene_that_stark_cannot_be_given_is_refused(change, tmp_path):
    scene = replace(load_shot(REPOSITORY / rows.PILES, {"name": "stack"}).scene, **change)
    with pytest.raises(Mistake, match="STARK is not given"):
        shot.write(scene, tmp_path / "shot.npz")
    damped = replace(scene.bodies[0], material=NeoHookean(2e5, damping=0.1))
    with pytest.raises(Mistake, match="damping"):
        shot.write(replace(scene, bodies=(damped,)), tmp_path / "shot.npz")


# ---- runs


@pytest.mark.slow
def test_runs_in_turn_and_what_is_kept(tiny, words, monkeypatch, tmp_path, capsys):
    turns = []

    def by_stark(folder, aside, cache, steps):
        """In STARK's place: its time is twice a second, and all its vertices stay where they are."""
        turns.append(sorted(path.name for path in aside.iterdir()))
        with np.load(aside / "shot.npz") as arrays:
            rest = np.concatenate([arrays["points_0"], arrays["points_1"]])
        return record((9.0, 2.0), newton=[1, 1], dt=[0.01] * 2), rest

    monkeypatch.setattr(stark, "check_module", lambda folder: None)
    monkeypatch.setattr(stark, "by_stark", by_stark)
    assert stark.main([*words, "--stark", str(tmp_path), "--repeats", "2"]) == 0
    assert len(turns) == 2 and "shot.npz" in turns[0] and "pdvol.log" not in turns[0] and "pdvol.log" in turns[1]
    kept = json.loads((tmp_path / "out" / "stark.json").read_text())["rows"]["tiny"]
    ours = kept["pdvol"][0]
    assert len(ours["seconds"]) == len(ours["newton"]) == 2 and min(ours["seconds"]) > 0.0 and ours["tick"] > 0.0
    # 16 vertices in two cubes that have fallen by less than g t^2 in two steps, in the order of what STARK was given
    assert ours["vertices"] == 16 and ours["inverted"] == 0 and 0.0 < ours["apart"][1] < 9.81 * 0.02**2
    text = (tmp_path / "page.md").read_text()
    assert text.startswith(f"# Title\n\n{stark.BEGIN}\n") and text.endswith(f"{stark.END}\nafter\n")
    assert "| two cubes | 16 | 2 (2) |" in text and "\nold\n" not in text
    assert capsys.readouterr().out.strip() in text
    # Another row joins the first one.
    monkeypatch.setitem(rows.ROWS, "other", replace(rows.ROWS["tiny"], title="the same again"))
    words[words.index("tiny")] = "other"
    assert stark.main([*words, "--stark", str(tmp_path), "--repeats", "1"]) == 0
    text = (tmp_path / "page.md").read_text()
    assert "| two cubes | 16 | 2 (2) |" in text and "| the same again | 16 | 2 (1) |" in text


def test_a_run_of_stark_that_fails_is_a_row_with_its_reason(tiny, words, tmp_path):
    (tmp_path / "pystark").mkdir()
    (tmp_path / "pystark" / "__init__.py").write_text("class Settings: pass\n")
    assert stark.main([*words, "--stark", str(tmp_path), "--repeats", "1"]) == 1
    text = (tmp_path / "page.md").read_text()
    assert "stark failed: AttributeError: module 'pystark' has no attribute" in text


def test_a_march_that_stops_early_is_a_failed_one():
    whole = {"ticks": [1.0, 3.0], "seconds": [1.0] * 3, "dt": [0.01, 0.005, 0.005]}
    found = stark.ended(dict(whole), 2, "", 0.1)
    assert (found["tick"], found["reason"], found["load"]) == (2.0, "", 0.1) and "ticks" not in found
    assert stark.ended(dict(whole), 5, "", 0.1)["reason"] == "stopped after 2 of 5 steps and 3 s"
    assert stark.ended({}, 5, "", 0.1)["reason"].startswith("stopped after 0 of 5")


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


# ---- mistakes


@pytest.mark.parametrize(
    "more, said",
    [
        ((), "--stark DIR is missing"),
        (("--stark", "/nonexistent"), "there is no such folder"),
        (("--stark", "."), "has no pystark/__init__.py"),
        (("--scenes", "nothing"), "there is no scene 'nothing'"),
        (("--repeats", "0"), "--repeats needs"),
        (("--steps", "1"), "--steps one from 2 on"),
        (("--peers", "/nonexistent"), "name the folder of the peers' meshes"),
        (("--docs", __file__), "once each"),
        (("--docs", "/nonexistent"), "No such file"),
    ],
)
def test_a_mistake_is_one_line(more, said, tiny, words, capsys):
    code = stark.main([*words, *more])
    shown = capsys.readouterr()
    assert code == 2 and shown.err.startswith("benchmarks.stark: ") and shown.err.count("\n") == 1 and not shown.out
    assert said in shown.err


def test_a_module_that_cannot_be_imported_is_one_line(tiny, words, tmp_path, capsys):
    (tmp_path / "pystark").mkdir()
    (tmp_path / "pystark" / "__init__.py").write_text("raise ImportError('built for another Python')\n")
    code = stark.main([*words, "--stark", str(tmp_path)])
    shown = capsys.readouterr()
    assert code == 2 and shown.err.count("\n") == 1
    assert "import pystark fails: ImportError: built for another Python; build it for Python 3." in shown.err
