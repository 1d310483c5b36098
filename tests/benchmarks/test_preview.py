"""The study of previews: its measures on motions made by hand, and its page."""

import numpy as np

from benchmarks.preview import page, shots
from benchmarks.time_order.__main__ import grid


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
    assert [row.split(" | ")[1] for row in rows[2:]] == ["10"] * 2 + ["0"] * 2


def test_the_page_has_what_the_command_makes():
    text, made = page.DOCS.read_text(), page.Page(page.DOCS, "preview", "table").text
    assert made.count("\n| level") == 8 and all(kind in made for kind in shots.KINDS)
    for name in ("how_right_bar", "how_right_ape"):
        for ending in ("webp", "png"):
            assert f"pictures/{name}.{ending}" in text and (page.PICTURES / f"{name}.{ending}").stat().st_size < 6e6
