"""The study of distances between levels prints a table, and refuses a run of one level."""

from pathlib import Path

import pytest

from benchmarks.divergence import __main__ as divergence
from pdvol.cli import run

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    out = tmp_path_factory.mktemp("divergence") / "run"
    words = ["--set", "cuts=((4, 1), (8, 2), (12, 3))", "--steps", "4", "--out", str(out)]
    assert run(["run", str(ROOT / "demos" / "twist.py"), *words]) == 0
    return out


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
