"""The study of bindings writes its tables on one small pair."""

from benchmarks.binding import __main__ as binding
from benchmarks.binding.__main__ import Pair


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
