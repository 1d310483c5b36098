"""The study of Hertz contact: its measures on Hertz's own pressures, its mesh, and two coarse refinements."""

import numpy as np
import pytest

from benchmarks.hertz import __main__ as hertz
from pdvol.geometry.level_mesh import simplex_volumes


def test_the_hemisphere():
    """Sound cells, half a ball but for the trimmed sides, and a bottom on the sphere."""
    mesh = hertz.hemisphere(6, 0.1)
    assert simplex_volumes(mesh.points, mesh.cells).min() > 0.0
    assert 0.8 < simplex_volumes(mesh.points, mesh.cells).sum() / (2.0 / 3.0 * np.pi) < 1.0
    skin = np.unique(mesh.boundary)
    bottom = skin[mesh.points[skin, 2] < 0.19]
    np.testing.assert_allclose(np.linalg.norm(mesh.points[bottom] - [0.0, 0.0, 1.0], axis=1), 1.0, rtol=1e-12)


def test_extrapolation():
    """Exact for c + k h^p."""
    order, limit = hertz.extrapolated([3.0 + 2.0 * h**1.5 for h in (0.4, 0.2, 0.1)])
    assert order == pytest.approx(1.5) and limit == pytest.approx(3.0)
    order, limit = hertz.extrapolated([1.02, 1.001, 1.004])
    assert np.isnan(order) and limit == 1.004


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
