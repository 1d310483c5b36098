"""The comparison of methods in a short form."""

import json

import pytest

from benchmarks.methods import __main__ as methods


@pytest.mark.slow
def test_a_short_study(tmp_path, capsys):
    words = ["slit_array", "--levels", "2", "--steps", "2", "--out", str(tmp_path)]
    assert methods.main(words) == 0
    out = capsys.readouterr().out
    assert out.count("| progressive, consistency ") == 6 and (tmp_path / "slit_array.md").read_text() in out
    result = json.loads((tmp_path / "slit_array.json").read_text())
    weights = (0.0, 4e-5, 0.025, 0.2, 0.4, 0.6)
    assert [case["settings"]["consistency"] for case in result["cases"]] == pytest.approx(weights)
    for case in result["cases"]:
        assert [level["states"] for level in case["levels"]] == [3, 3] and case["levels"][1]["crossings"] == 0
    for name in ("slit_array_sweep.png", "slit_array_curves.png"):
        assert (tmp_path / name).read_bytes()[:4] == b"\x89PNG"
    written = {p: p.stat().st_mtime_ns for p in (tmp_path / "slit_array").rglob("states.bin")}
    assert methods.main(words) == 0  # finished runs are taken as they are
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "slit_array").rglob("states.bin")} == written
    assert not any(methods.main([*words, "--only", f"={w:g}"]) for w in weights), "each case has figures alone"
    assert methods.main([*words[:-1], "/proc/nowhere"]) == 2


@pytest.mark.slow
def test_metrics_of_interpolants_and_crossings_are_drawn(tmp_path):
    words = ["rope_drop", "--only", "progressive", "--levels", "2", "--steps", "3", "--out", str(tmp_path)]
    assert methods.main(words) == 0 and methods.main(["dice_and_wizard", *words[3:]]) == 0
    cases = json.loads((tmp_path / "rope_drop.json").read_text())["cases"]
    assert [case["prolongation"] for case in cases] == ["barycentric", "biharmonic", "phong"]
    for finest in (case["levels"][1] for case in cases):
        assert [len(finest[key]) for key in ("continuity", "continuity_error", "consistency")] == [3, 3, 4]
    for name in ("rope_drop.png", "rope_drop_metrics.png", "dice_and_wizard.png"):
        assert (tmp_path / name).read_bytes()[:4] == b"\x89PNG"
