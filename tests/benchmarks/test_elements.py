"""The study of smoothed elements: a bar whose frequencies are known from quadratic elements, and its command line."""

import pytest

from benchmarks.elements import __main__ as study
from benchmarks.elements import frequencies


def test_a_bar_of_two_cells():
    """Bending and torsion, squared frequencies: linear elements more than twice the truth, smoothed ones near it."""
    (row,) = frequencies.bars((2,))
    assert min(row["linear"]) > 2.0
    assert 1.0 < row["smoothed"][0] < 1.15 and 1.0 < row["smoothed"][1] < 1.25
    assert 1.5 < row["blocks smoothed"] / row["blocks linear"] < 3.0


@pytest.mark.parametrize("words", [("--rows", "nothing"), ("--docs", "/nonexistent"), ("--docs", __file__)])
def test_a_mistake_is_one_line(words, capsys):
    assert study.main([*words]) == 2
    shown = capsys.readouterr()
    assert shown.err.startswith("benchmarks.elements: ") and shown.err.count("\n") == 1 and not shown.out
