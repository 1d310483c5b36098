"""Pictures of bindings: what the colours say, and that both halves are drawn."""

import numpy as np
import pytest
import scipy.sparse as sp
from PIL import Image

import runs
from pdvol.studio.draw.bindings import CAPTION_HEIGHT, cell_colours, draw_binding, weight_colours


@pytest.mark.parametrize("dim", [2, 3])
def test_both_halves_are_drawn(dim, tmp_path):
    coarse, fine = runs.level_meshes(dim, (60, 400))
    rng = np.random.default_rng(0)
    cells = rng.integers(0, len(coarse.cells), len(fine.points))
    n = len(fine.points)
    places = np.repeat(np.arange(n), 3), coarse.cells[cells][:, :3].ravel()
    weights = sp.csr_matrix((np.full(3 * n, 1 / 3), places), shape=(n, len(coarse.points)))
    colours, row = cell_colours(np.array([7, 3, 7, 900, 3])), cell_colours(np.arange(50))
    np.testing.assert_array_equal((colours[:, None] == colours[None]).all(axis=2)[0], [True, False, True, False, False])
    assert np.linalg.norm(np.diff(row, axis=0), axis=1).min() > 0.3, "cells that follow each other differ clearly"
    warm, weak, nothing, cool = weight_colours(np.array([1.0, 0.01, 0.0, -0.5]))
    assert warm[0] > warm[2] and cool[2] > cool[0] and np.ptp(nothing) < 0.05 < np.linalg.norm(weak - nothing)
    path = draw_binding(
        tmp_path / "binding_1.png", coarse, fine, cells, weights, "levels 0 -> 1", up=(0, 0, 1), width=240
    )
    image = np.asarray(Image.open(path).convert("RGB"), dtype=int)
    assert image.shape[1] == 488
    left, right = image[CAPTION_HEIGHT:, :240], image[CAPTION_HEIGHT:, 248:]
    vivid = lambda half: (np.ptp(half, axis=2) > 60).mean()
    assert vivid(left) > 0.02 and 0 < vivid(right) < vivid(left)
