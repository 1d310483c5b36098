"""Distances between levels: those of `pdvol metrics` for neighbours, and nothing between levels that only follow."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.divergence import __main__ as divergence
from pdvol import open_run
from pdvol.cli import run
from pdvol.runs.run_metrics import measure_run

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    out = tmp_path_factory.mktemp("divergence") / "run"
    words = ["--set", "cuts=((4, 1), (8, 2), (12, 3))", "--steps", "4", "--out", str(out)]
    assert run(["run", str(ROOT / "demos" / "twist.py"), *words]) == 0
    return out


def test_neighbours_are_as_far_apart_as_metrics_say(path):
    found = divergence.distances(open_run(path))
    assert sorted(found) == [(1, 0), (2, 0), (2, 1)]
    for level in measure_run(path)["levels"][1:]:
        np.testing.assert_allclose(found[level["level"], level["level"] - 1], level["distance"], rtol=1e-9, atol=1e-15)


def test_level_0_carried_up_is_no_distance_away(path, monkeypatch):
    stored = open_run(path)
    stretch = np.array([[1.2, 0.3, 0.0], [0.0, 0.9, 0.1], [0.0, 0.0, 1.1]])
    monkeypatch.setattr(type(stored.levels[0]), "positions", lambda level, step: level.rest @ stretch + 0.1 * step)
    for values in divergence.distances(stored).values():
        assert np.abs(values).max() < 1e-12  # affine motions are the same on all levels


def test_the_command_prints_a_table_and_draws(path, tmp_path, capsys):
    assert divergence.main([str(path), "-o", str(tmp_path / "figure.png")]) == 0
    assert "| 2 from 0 | 4 |" in capsys.readouterr().out
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_a_run_of_one_level_is_refused(tmp_path, capsys):
    out = tmp_path / "single"
    assert (
        run(["run", str(ROOT / "demos" / "twist.py"), "--set", "cuts=((4, 1),)", "--steps", "1", "--out", str(out)])
        == 0
    )
    assert divergence.main([str(out)]) == 2
    assert "no two levels" in capsys.readouterr().err
