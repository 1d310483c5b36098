"""What benchmarks.binding measures, on meshes whose answer is known, and its tables on one small pair."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.binding import __main__ as binding
from benchmarks.binding.__main__ import Pair
from shapes import box


def test_snapping_moves_each_vertex_to_the_nearest_fine_one():
    coarse, fine = box(2, 2), box(2, 4)
    assert (binding.snap(coarse, fine) == coarse.points).all(), "every coarse vertex is a fine one"
    middle = np.flatnonzero((coarse.points == 0.5).all(axis=1))
    shifted = fine.points + [0.1, 0.0]
    moved = replace(fine, points=shifted)
    assert np.allclose(binding.snap(coarse, moved) - coarse.points, [0.1, 0.0])
    at_boundary = binding.snap(coarse, moved, boundary_only=True)
    assert (at_boundary[middle] == coarse.points[middle]).all(), "inner vertices stay"
    assert np.abs(at_boundary - coarse.points).max() == pytest.approx(0.1)


def test_the_reach_of_barycentric_weights_is_an_edge():
    coarse, fine = box(2, 2), box(2, 4)
    weights = np.zeros((len(fine.points), len(coarse.points)))
    same = np.linalg.norm(fine.points[:, None] - coarse.points[None], axis=2) == 0.0
    weights[same] = 1.0
    assert binding.reach(weights, coarse, fine) == 0.0
    corner = np.flatnonzero((coarse.points == 0.0).all(axis=1))[0]
    weights[fine.points.sum(axis=1).argmax(), corner] = 1.0  # from the opposite corner
    assert binding.reach(weights, coarse, fine) == pytest.approx(np.sqrt(2.0) / binding.mean_edge(coarse))


def test_it_writes_tables_and_pictures(tmp_path, monkeypatch, capsys):
    small = Pair("extreme_shapes", 1, 0, (65, 100))
    for name in ("PAIRS", "SIMILAR", "SEAHORSE"):
        monkeypatch.setattr(binding, name, (small,) if name == "PAIRS" else small)
    page = tmp_path / "binding.md"
    page.write_text("before\n<!-- benchmarks.binding: tables -->\n<!-- benchmarks.binding: end -->\nafter\n")
    (tmp_path / "pictures").mkdir()
    assert binding.main(["--docs", str(page)]) == 0
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("\nafter\n") and text.count("| `extreme_shapes`") == 2
    for name in ("snapping", "locality"):
        assert (tmp_path / "pictures" / f"binding_{name}.png").read_bytes().startswith(b"\x89PNG")
    coarse, fine = small.meshes
    cells = [cell.strip() for cell in text.splitlines()[-3].split("|")]
    assert cells[3:5] == ["3", str(len(coarse.points))], "all weights, before"
    assert 3.0 < float(cells[6]) < len(coarse.points) and float(cells[9]) < 1e-10, "fewer after, and still affine"
    assert binding.main(["--docs", str(tmp_path / "none.md")]) == 2
    assert "none.md" in capsys.readouterr().err
