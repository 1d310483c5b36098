"""Studies that march rows (dense, elements, ranks, stark) in a short form, and the figures of their records."""

import json
import types
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.ablation import __main__ as ablation
from benchmarks.binding import __main__ as binding
from benchmarks.common import commits, march
from benchmarks.common import rows as common_rows
from benchmarks.common.process import REPOSITORY
from benchmarks.dense import __main__ as dense
from benchmarks.elements import __main__ as elements
from benchmarks.extremes import __main__ as extremes
from benchmarks.fronts import __main__ as fronts
from benchmarks.hertz import __main__ as hertz
from benchmarks.live import __main__ as live
from benchmarks.methods import __main__ as methods
from benchmarks.ranks import __main__ as ranks
from benchmarks.stark import __main__ as stark
from benchmarks.stress import __main__ as stress
from benchmarks.time_order import __main__ as time_order


def page_of(study, what="tables"):
    """A page that keeps a study's tables."""
    return f"# Title\n\n<!-- benchmarks.{study}: {what} -->\nold\n<!-- benchmarks.{study}: end -->\nafter\n"


@pytest.fixture
def tiny(monkeypatch):
    """A row of two cubes of eight vertices, two steps."""
    row = common_rows.pile("stack", 2, "two cubes")
    row = replace(row, settings={**row.settings, "count": 2, "cuts": 1})
    monkeypatch.setitem(common_rows.ROWS, "tiny", row)
    return row


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
    compared, parts = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| two cubes")]
    assert compared.startswith("| two cubes, 1 and 2 ranks | 16 | 2 (1) | ") and parts.count(", ") == 6


@pytest.fixture
def words(tmp_path):
    """A command line of stark without mistakes, but for the folder of STARK."""
    (tmp_path / "page.md").write_text(page_of("stark", "table"))
    (tmp_path / "README.md").touch()
    return ["--docs", f"{tmp_path}/page.md", "--out", f"{tmp_path}/out", "--peers", str(tmp_path), "--scenes", "tiny"]


def test_stark_in_turn_and_what_is_kept(tiny, words, monkeypatch, tmp_path):
    def by_stark(row, steps, meshes, options):
        """In STARK's place: its time is twice a second, and all its vertices stay where they are."""
        rest = np.concatenate([points for points, _ in meshes])
        state = {"rest": rest, "last": rest, "cells": np.array([[0, 1, 2, 4]]), "step": steps}
        record = {"seconds": [9.0, 2.0], "newton": [2, 4, 6], "tick": 1.0, "vertices": 1200, "reason": ""}
        return stark.ended(record | {"dt": [0.01] * 2}, steps, "", state), state

    monkeypatch.setattr(stark, "check_module", lambda folder: None)
    monkeypatch.setattr(stark, "by_stark", by_stark)
    assert stark.main([*words, "--stark", str(tmp_path), "--repeats", "2"]) == 0
    kept = json.loads((tmp_path / "out" / "stark.json").read_text())["rows"]["tiny"]
    # 16 vertices in two cubes that have fallen by less than g t^2 in two steps, in the order of what STARK was given
    assert kept["pdvol"][0]["inverted"] == 0 and 0.0 < kept["apart"][1] < 9.81 * 0.02**2
    text = (tmp_path / "page.md").read_text()
    assert "| two cubes | 16 | 2 (2) |" in text and "\nold\n" not in text and text.endswith("-->\nafter\n")


# ---- mistakes


@pytest.mark.parametrize(
    "study, more, said",
    [
        (stark, (), "--stark DIR is missing"),
        (stark, ("--stark", "/nonexistent"), "has no pystark/__init__.py"),
        (stark, ("--scenes", "nothing"), "there is no 'nothing'"),
        (stark, ("--repeats", "0"), "--repeats needs"),
        (stark, ("--peers", "/nonexistent"), "name the folder of the peers' meshes"),
        (stark, ("--docs", __file__), "once each"),
        (stark, ("--docs", "/nonexistent"), "No such file"),
        (dense, ("--scenes", "nothing"), "there is no 'nothing'"),
        (dense, ("--against", "zzzz"), "zzzz"),
        (dense, ("--docs", __file__), "once each"),
        (elements, ("--rows", "nothing"), "there is no 'nothing'"),
        (elements, ("--docs", __file__), "once each"),
        (ranks, ("--rows", "nothing"), "there is no 'nothing'"),
        (ablation, ("lengthening,hope",), "hope"),
        (ablation, ("--rows", "nowhere"), "nowhere"),
        (binding, ("--docs", "/nonexistent"), "No such file"),
        (extremes, ("--rows", "nothing"), "nothing"),
        (fronts, ("spike,nothing",), "nothing"),
        (hertz, ("--cells", "two"), "two"),
        (live, ("nothing",), "there is no 'nothing'"),
        (methods, ("slit_array", "--only", "nothing"), "no case of slit_array has 'nothing' in its name"),
        (stress, ("--scenes", "nothing"), "nothing"),
        (time_order, ("--parts", "order,speed"), "there is no 'speed'; choose from order, levels"),
    ],
)
def test_a_mistake_is_one_line(study, more, said, tiny, words, tmp_path, capsys):
    name = study.__name__.split(".")[1]
    own = {"stark": words, "dense": ["--out", str(tmp_path)]}.get(name, [])
    code, shown = study.main([*own, *more]), capsys.readouterr()
    assert code == 2 and shown.err.startswith(f"benchmarks.{name}: ") and shown.err.count("\n") == 1 and not shown.out
    assert said in shown.err
