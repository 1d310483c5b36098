"""The file's arrays, decoded by a reader of its own, are the stored states within the stated error."""

import base64
import re
import zlib

import numpy as np
import pytest

import runs
from page_data import Decoded
from pdvol.store.reader import open_run
from pdvol.studio.play.document import player_page, write_player
from pdvol.studio.play.packing import Chunks, quantised, residuals
from pdvol.studio.play.panes import panes_of_run, thinned


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_filters_lose_nothing(order, kind):
    # Also the wildest motion, whose residuals leave the range of the numbers.
    values = np.random.default_rng(3).integers(0, np.iinfo(kind).max, (5, 7, 3), endpoint=True).astype(kind)
    entry = {"type": np.dtype(kind).name, "shape": [5, 7, 3], "filter": str(order)}
    page = Decoded('<script id="data" type="application/json">{"chunks": []}</script>')
    page.data["chunks"], page.texts = [entry], [base64.b64encode(zlib.compress(residuals(values, order))).decode()]
    assert np.array_equal(page.array(0), values)


def test_steady_motion_takes_few_bytes():
    start, velocity = np.random.default_rng(2).integers(0, 1000, (2, 1, 1000, 1))
    steady = (start + velocity * np.arange(50)[:, None, None]).astype(np.uint16)
    chunks = Chunks()
    chunks.states(steady)
    assert chunks.entries[0]["filter"] == "2" and len(chunks.texts[0]) < steady.nbytes / 10


def test_quantised_values_are_within_half_a_unit():
    rng = np.random.default_rng(1)
    low, span = np.array([-3.0, 0.0, 5.0]), np.array([7.0, 0.0, 1e-3])
    values = low + span * rng.uniform(0.0, 1.0, (200, 3))
    back = low + span * quantised(values, low, span) / 65535
    assert (abs(back - values) <= span / 65535 / 2 * (1 + 1e-9)).all()
    assert quantised(low + span, low, span).tolist() == [65535, 0, 65535]


@pytest.mark.parametrize("dim", [2, 3])
def test_positions_are_the_stored_ones_within_the_stated_error(dim, flat_run, solid_run):
    run = open_run(flat_run if dim == 2 else solid_run)
    page = Decoded(player_page(panes_of_run(run)))
    assert len(page.data["panes"]) == 2
    for pane, level in zip(page.data["panes"], run.levels, strict=True):
        facets = level.surface if dim == 3 else level.cells
        drawn = np.unique(facets)  # the input's order
        stored = np.stack([level.positions(step)[drawn] for step in range(level.steps)])
        shown = page.positions(pane)
        assert shown.shape == stored.shape
        assert abs(shown - stored).max() <= pane["error"] < 1e-4
        assert abs(shown - stored).max() > pane["error"] / 20  # the bound means something
        assert np.array_equal(drawn[page.array(pane["faces"]).reshape(facets.shape)], facets)
        assert np.array_equal(page.array(pane["bodies"]), level.mesh.point_bodies[drawn])
        shapes = [obstacle for obstacle in run.obstacles if obstacle.kind == "mesh"]
        for obstacle, there in zip([o for o in pane["obstacles"] if o["kind"] == "mesh"], shapes, strict=True):
            places = page.positions(obstacle)
            assert len(places) == (level.steps if "positions" in there.arrays else 1)
            for step, place in enumerate(places):
                assert abs(place - there.vertices(step)).max() <= obstacle["error"] < 1e-4
    if dim == 3:
        assert np.allclose(pane["obstacles"][0]["places"], [[0, 0, -0.01, 0, 0, 1]]), "a plane"


def test_a_thinned_file_has_its_states_and_the_curves_of_these(flat_run, solid_run):
    for path, every, steps in ((flat_run, 4, [0, 4, 6]), (solid_run, 3, [0, 3, 4])):
        run = open_run(path)
        page, whole = (Decoded(player_page(thinned(panes_of_run(run, [1]), n))) for n in (every, 1))
        (pane,), (other,) = page.data["panes"], whole.data["panes"]
        assert (pane["states"], pane["dt"], pane["end"]) == (3, every * run.dt, other["end"])
        shown, all_shown = page.positions(pane), whole.positions(other)
        assert abs(shown - all_shown[steps]).max() <= pane["error"] + other["error"]
        for name, values in pane["curves"].items():
            np.testing.assert_allclose(values, np.array(other["curves"][name])[steps], rtol=1e-5)
        rising = [obstacle for obstacle in pane["obstacles"] if obstacle["kind"] == "mesh"][1:]
        for obstacle in rising:
            for step, place in zip(steps, page.positions(obstacle), strict=True):
                assert abs(place - run.obstacles[2].vertices(step)).max() <= obstacle["error"]


def test_an_obstacle_that_contact_held_back_is_shown_so(tmp_path):
    path = runs.stored_run(tmp_path / "late", 2, (40,), 4)
    level = open_run(path).levels[0]
    np.savez(level.folder / "late_000003.npz", **{"0.point": [0.0, 0.25], "0.normal": [0.0, 1.0]})
    ground = Decoded(player_page(panes_of_run(open_run(path)))).data["panes"][0]["obstacles"][0]
    assert [place[1] for place in ground["places"]] == [-0.01, -0.01, -0.01, 0.25, -0.01]


def test_names_are_escaped(tmp_path):
    mean = "</script><script>alert(1)</script>&\"'"
    meshes = runs.level_meshes(2, (40,))
    with runs.RunWriter.create(
        tmp_path / "run", {"scene": mean, "dt": 0.1, "steps": 0, "method": "direct"}, meshes, [mean, "b"]
    ) as writer:
        runs.write_obstacles(writer.path, [{"name": mean, "kind": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}])
        writer.write_state(0, 0, meshes[0].points)
    page = player_page(panes_of_run(open_run(tmp_path / "run")), mean)
    assert "alert(1)</script>" not in page and "<script>alert" not in page
    data = Decoded(page).data
    assert data["title"] == data["panes"][0]["names"][0] == data["panes"][0]["obstacles"][0]["name"] == mean


def test_the_page_names_no_address(solid_run, tmp_path):
    page = write_player(panes_of_run(open_run(solid_run)), tmp_path / "a" / "shot.html").read_text()
    own = page[: page.index("var THREE=")] + page[page.index('"use strict";') :]
    assert re.findall(r"""(?:src|href|url)\s*[=(]""", own) == []
    assert set(re.findall(r"https?://[^\s\"'`)]+", own)) <= {"http://www.w3.org/2000/svg"}
    assert "default-src 'none'" in own
