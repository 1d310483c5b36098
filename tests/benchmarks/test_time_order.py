"""The study of integrators: its measures on states made by hand, its swings beside their formula, and a short shot."""

import numpy as np
import pytest

from benchmarks.time_order import __main__ as study


def test_distances_by_hand():
    one, other = np.zeros((2, 2)), np.array([[0.3, 0.4], [0.3, 0.4]])
    assert study.apart(one, other) == pytest.approx(0.5)
    assert study.over_shot({"x": [one, one]}, {"x": [other, one]}) == pytest.approx(0.25)


def test_states_are_those_of_common_times():
    scene = study.cantilever(damping=0.02)
    coarse, fine = (study.states(scene, dt, "bdf2", steps=5)[0] for dt in (study.DT, study.DT / 5.0))
    assert len(coarse["x"]) == len(fine["x"]) == 5 and fine["newton"] > coarse["newton"] > 0
    assert 0.0 < study.over_shot(coarse, fine) < 1e-3


def test_swings_keep_what_their_formula_says():
    rows = [row.strip("| ").split(" | ")[1:] for row in study.swings(2).splitlines()[2:]]
    left, expected = np.array([[float(cell.rstrip("%")) for cell in row] for row in rows]).T
    np.testing.assert_allclose(left, expected, atol=0.1)
    assert left[0] < 45.0 and left[1] > 96.0


def test_bad_words_are_refused(capsys):
    assert study.main(["--parts", "order,speed"]) == 2
    assert capsys.readouterr().err == (
        "benchmarks.time_order: there is no part 'speed'; there are order, swings, shots, levels\n"
    )
