"""Render meshes in the player: where the run's weights put them, cut at seams, with textures of a bounded size."""

import io

import numpy as np
import pytest
from PIL import Image

from cli_scenes import pdvol as command
from page_data import Decoded
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.play.details import TEXTURE_SIDE, Detail, texture_bytes
from pdvol.studio.play.document import player_page
from pdvol.studio.play.panes import MOST_VERTEX_STATES, drawn_vertices, panes_of_run, thinned


def test_they_follow_the_weights(detailed_run):
    run = open_run(detailed_run)
    (pane,) = panes_of_run(run)
    page, level = Decoded(player_page([pane])), run.levels[0]
    (entry,) = page.data["panes"][0]["details"]
    bodies = page.array(page.data["panes"][0]["bodies"])[page.array(page.data["panes"][0]["faces"]).reshape(-1, 3)]
    bare = page.data["panes"][0]["uncovered"]
    assert 0 < bare < len(bodies), "bodies without a render mesh come first"
    assert set(bodies[:bare].ravel()) == {1} and set(bodies[bare:].ravel()) == {0}
    (mesh,) = run.render_meshes
    weights, detail = level.render_weights(mesh), Detail(mesh)
    bound = page.data["panes"][0]["error"]
    shown = page.positions(entry)
    for step in range(level.steps):
        exact = (weights @ level.positions(step))[detail.vertices]
        assert np.abs(shown[step] - exact).max() <= bound < 1e-4
    assert np.abs(shown[-1] - shown[0]).max() > 100 * bound
    faces = page.array(entry["faces"]).reshape(-1, 3)
    np.testing.assert_array_equal(detail.vertices[faces], mesh.triangles)
    places = page.array(entry["places"]).reshape(-1, 2)
    wanted = mesh.uvs[mesh.uv_corners[mesh.fans]]
    np.testing.assert_allclose(places[faces], wanted * [1, -1] + [0, 1], atol=1e-6)
    assert len(detail.vertices) > len(mesh.points)  # seams


def test_the_texture_is_in_the_file_as_it_was_or_smaller(detailed_run, tmp_path):
    page = Decoded(player_page(panes_of_run(open_run(detailed_run))))
    (mesh,) = open_run(detailed_run).render_meshes
    (entry,) = page.data["panes"][0]["details"]
    assert page.array(entry["texture"]).tobytes() == mesh.texture.read_bytes()
    large = np.zeros((600, 3 * TEXTURE_SIDE, 3), dtype=np.uint8)
    large[:, :TEXTURE_SIDE] = [200, 30, 30]
    Image.fromarray(large).save(tmp_path / "large.png")
    with Image.open(io.BytesIO(texture_bytes(tmp_path / "large.png"))) as small:
        assert small.size == (TEXTURE_SIDE, 200)
        assert abs(np.asarray(small)[100, 100].astype(int) - [200, 30, 30]).max() < 6
        assert np.asarray(small)[100, -100].max() < 6
    noise = np.random.default_rng(0).integers(0, 255, (800, 800, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "noise.png")
    assert (tmp_path / "noise.png").stat().st_size > 1_500_000 > len(texture_bytes(tmp_path / "noise.png"))
    (tmp_path / "broken.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match="broken.png"):
        texture_bytes(tmp_path / "broken.png")


def test_their_vertices_count_where_states_are_left_out(detailed_run, monkeypatch):
    (pane,) = panes_of_run(open_run(detailed_run))
    (mesh,) = open_run(detailed_run).render_meshes
    bare = Decoded(player_page([pane])).data["panes"][0]
    count = drawn_vertices(pane)
    assert count == len(Detail(mesh).vertices) + len(np.unique(pane.stored.surface)) and bare["details"]
    monkeypatch.setattr("pdvol.studio.play.panes.MOST_VERTEX_STATES", pane.states * count * 2 // 5)
    assert thinned([pane])[0].every == 3 and MOST_VERTEX_STATES > 1e7


def test_the_command_leaves_them_out(detailed_run, tmp_path, capfd):
    sizes = []
    for options in ((), ("--no-render-meshes",)):
        out = tmp_path / "shot.html"
        assert command("play", detailed_run, "-o", out, *options) == 0
        sizes.append(len(out.read_text()))
        pane = Decoded(out.read_text()).data["panes"][0]
        assert bool(pane["details"]) == (not options)
        assert ('id="shape"' in out.read_text()) == (not options)
    assert sizes[1] < sizes[0]
    (detailed_run / "levels" / "0" / "render_0.npz").unlink()
    assert command("play", detailed_run, "-o", tmp_path / "shot.html") == 2
    assert "--resume" in capfd.readouterr().err
