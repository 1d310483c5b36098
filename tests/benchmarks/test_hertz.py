"""The study of Hertz contact: two coarse refinements."""

import pytest

from benchmarks.hertz import __main__ as hertz


def test_refinement_comes_closer_to_hertz():
    """Force balances; with h and dhat halved, errors fall to 0.33 to 0.52. Order 1 is a half."""
    coarse, fine = (hertz.press(n, 0.1, hertz.DHAT / n) for n in (6, 12))
    for row in (coarse, fine):
        assert row["balance"] == pytest.approx(1.0, abs=1e-4)
    for key in hertz.FIGURES:
        assert abs(fine[key] - 1.0) < 0.6 * abs(coarse[key] - 1.0), key
    assert abs(fine["radius"] - 1.0) < 0.03 and abs(fine["pressure"] - 1.0) < 0.03


def test_bad_words_are_refused(capsys):
    assert hertz.main(["--cells", "two"]) == 2
    assert capsys.readouterr().err.startswith("benchmarks.hertz: ")
