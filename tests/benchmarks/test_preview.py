"""The study of previews: its measures on a short run and on motions made by hand, its page, and its command line."""

import numpy as np
import pytest

from benchmarks.preview import __main__ as study
from benchmarks.preview import page, shots
from benchmarks.time_order.__main__ import grid
from pdvol.runs.run_metrics import motion_from_level_0


def test_distances_and_drift_are_those_of_the_metrics(tmp_path, monkeypatch):
    """Of a short shot: zero at the start, and at the end what `pdvol.runs.run_metrics` says."""
    monkeypatch.setitem(shots.SHOTS, "spike", shots.Shot("ball_on_spike", 1, 30))
    run = shots.stored(tmp_path, "spike", **shots.DEFAULTS["new"])
    assert [level.steps for level in run.levels] == [31, 31]
    distance, drift = shots.from_level_0(run)[1], shots.drifts(run)[1]
    (at_end,) = motion_from_level_0(run)[1:]
    np.testing.assert_allclose([distance[0], *drift[0]], 0.0, atol=1e-6)
    assert distance[-1] == pytest.approx(at_end["distance"]) and distance[-1] > 1e-4
    assert drift[-1] == pytest.approx([at_end["centre_drift"], at_end["angle_drift"]])
    np.testing.assert_array_equal(shots.from_level_0(run, "ball")[1], distance)
    settings = run.info["parameters"]
    assert settings == {"integrator": "bdf2", "elements": "smoothed", "feedback": 0.05}


def test_the_bar_and_its_truth_share_their_vertices():
    truth = grid((1.0, 0.2), page.BAR_CUTS[-1]).vertices[None]
    for level, cuts in enumerate(page.BAR_CUTS):
        own = grid((1.0, 0.2), cuts).vertices
        np.testing.assert_allclose(page.of_level(truth, level)[0], own, atol=1e-12)
        moved = np.array([own, own + [0.0, 0.3]])
        np.testing.assert_allclose(page.tip(moved), [0.1, 0.4])
    still = lambda cuts: np.repeat(grid((1.0, 0.2), cuts).vertices[None], 8, axis=0)
    bars = {"one": [still(cuts) + [0.0, 0.01] for cuts in page.BAR_CUTS]}
    rows = page.bar_table(bars, still(page.BAR_CUTS[-1])).splitlines()
    assert [row.split(" | ")[1] for row in rows[2:]] == ["10"] * 3 + ["0"] * 3


def test_the_page_has_what_the_command_makes():
    text = page.PAGE.read_text()
    before, after = page.between(page.PAGE, page.BEGIN, page.END)
    made = text[len(before) + len(page.BEGIN) : len(text) - len(after) - len(page.END)]
    assert made.count("\n| level") == 14 and all(kind in made for kind in shots.KINDS)
    for name in ("how_right_bar", "how_right_ape"):
        for ending in ("webp", "png"):
            assert f"pictures/{name}.{ending}" in text and (page.PICTURES / f"{name}.{ending}").stat().st_size < 6e6


def test_bad_words_are_refused(capsys):
    assert study.main(["ape,speed"]) == 2
    assert capsys.readouterr().err == (
        "benchmarks.preview: there is no part 'speed'; there are ape, noodles, distances, drift\n"
    )
