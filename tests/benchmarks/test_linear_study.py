"""pdvol's linear solver beside PETSc's preconditioners."""

import pytest

import benchmarks.linear.__main__ as linear
from benchmarks.linear.one_rank import METHODS
from benchmarks.ranks.rows import Row

ROW = Row("a ball", "demos/ball_on_spike.py", 3)


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_each_method_solves_the_systems_of_a_run(ranks, tmp_path, monkeypatch):
    monkeypatch.setitem(linear.ROWS, "ball", ROW)
    rows = linear.measured("ball", ranks, tmp_path)
    assert len(rows) == 3, "a system of each step"
    for row in rows:
        assert 0.0 < row["tolerance"] < 0.1
        for method in ("pdvol", *METHODS):
            _, _, iterations, solved = row[method]
            assert solved and iterations > 0, method


def test_the_table_has_times_over_pdvol_s(monkeypatch):
    monkeypatch.setitem(linear.ROWS, "ball", ROW)
    found = {"pdvol": (0.001, 0.003, 9, True), **dict.fromkeys(METHODS, (0.002, 0.01, 8, False))}
    lines = linear.table({"ball": {2: [found, found]}}).splitlines()
    assert lines[2] == "| a ball | 2 | 2 | pdvol | 9.0 | 1.0 | 3.0 | 1.00 | 0 |"
    assert lines[3] == "| a ball | 2 | 2 | block Jacobi, ICC(0) | 8.0 | 2.0 | 10.0 | 3.00 | 2 |"
