"""Pictures and films are drawn without a display and without output on the terminal, and they are not empty."""

import importlib.util
import io
import os
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import runs
from commands import SAFETY
from pdvol.cli import run as command
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.store.writer import RunWriter
from pdvol.studio.draw.compose import Grid, Pane, frames
from pdvol.studio.draw.contact_shadows import shadow_map
from pdvol.studio.draw.film import film_rate, film_steps, write_film
from pdvol.studio.draw.layout import CELL_GAP
from pdvol.studio.draw.picture import CAPTIONS, chosen_steps, picture, render
from pdvol.studio.draw.views import Shot
from rendered import entry_of, grown_box, write_render_meshes
from shapes import box

SMALL = Shot(width=120)


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB"), dtype=int)


@pytest.mark.parametrize("kind", ["flat_run", "solid_run"])
def test_a_picture_shows_the_bodies(kind, request, tmp_path):
    run = open_run(request.getfixturevalue(kind))
    rgb = pixels(render(run, tmp_path / "new" / "run.png", steps=[0, 2, 4], shot=Shot(width=200)))
    assert rgb.shape[1] == CAPTIONS[0] + 3 * (200 + CELL_GAP) and rgb.shape[0] > 2 * 120
    assert len(np.unique(rgb.reshape(-1, 3), axis=0)) > 500
    warm, cool = (rgb[..., 0] - rgb[..., 2] > 60).mean(), (rgb[..., 2] - rgb[..., 0] > 40).mean()
    assert warm > 0.01 and cool > 0.01, "both bodies, apricot and teal"


def test_a_display_that_is_not_there_is_not_asked_for_and_no_word_is_said(solid_run, tmp_path):
    code = f"""
from pdvol.studio.draw.picture import render
from pdvol.store.reader import open_run
render(open_run({str(solid_run)!r}), {str(tmp_path / "run.png")!r}, levels=[0], steps=[1])
"""
    env = {key: value for key, value in os.environ.items() if key != "WAYLAND_DISPLAY"} | {"DISPLAY": ":77"}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=SAFETY)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_an_unfinished_run_is_drawn(small_run, tmp_path):
    runs.keep_states(small_run / "levels" / "1", 2)
    run = open_run(small_run)
    assert render(run, tmp_path / "run.png", shot=SMALL).exists()
    for words, message in (
        ({"steps": [9]}, "steps to draw must lie between 0 and 6"),
        ({"levels": [4]}, "no stored state of level 4"),
        ({"levels": []}, "at least one level"),
        ({"path": "run.bmp"}, "ends in .png, .gif, .mp4, .webp"),
        ({"shot": Shot(cut="x=0")}, "--cut: .* is 2D"),
    ):
        with pytest.raises(InputError, match=message):
            render(run, **{"path": tmp_path / "x.png", **words})


@pytest.mark.parametrize("ending", ["gif", "mp4", "webp"])
def test_films(flat_run, tmp_path, monkeypatch, ending):
    """Pages show a WebP like a picture; imageio reads the others. Sides of videos are even."""
    imageio = pytest.importorskip("imageio.v2")
    path = render(open_run(flat_run), tmp_path / f"run.{ending}", shot=Shot(width=121))
    if ending == "webp":
        with Image.open(path) as film:
            assert (film.format, film.n_frames, film.info["loop"]) == ("WEBP", 4, 0)
            shown = [film.seek(k) or np.asarray(film.convert("RGB"), dtype=int) for k in range(4)]
            assert film.info["duration"] in (40, 41)  # 25 frames a second
    else:
        with imageio.get_reader(path) as film:
            shown = [np.asarray(frame)[..., :3].astype(int) for frame in film]
    assert len(shown) == 4  # 7 states, every second one: 25 frames a second
    assert shown[0].shape[1] == 2 * 121 + CELL_GAP and (abs(shown[-1] - shown[0]) > 60).any()
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    if ending == "mp4":
        write_film(path, [Image.new("RGB", (65, 33), "#ff0000")] * 2, 10.0)
        with imageio.get_reader(path) as film:
            assert [frame.shape for frame in film] == [(34, 66, 3)] * 2
        monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
        with pytest.raises(InputError, match=r"pip install 'imageio\[ffmpeg\]'"):
            render(open_run(flat_run), path)


def test_a_render_mesh_is_drawn_with_its_texture(tmp_path):
    """A box whose faces are blue above and green below, and by its facets of the first body's colour, also where it is
    cut.
    """
    texture, buffer, mesh = np.zeros((8, 8, 3), dtype=np.uint8), io.BytesIO(), box(3, 2)
    texture[:4], texture[4:] = (0, 0, 255), (0, 255, 0)
    Image.fromarray(texture).save(buffer, "PNG")
    with RunWriter.create(tmp_path / "run", {"dt": 0.05, "steps": 0}, [mesh], ["left"]) as run:
        grown = grown_box(0.0, 1.0, 0.03)
        write_render_meshes(run.path, [entry_of(mesh, 0, grown, texture=(buffer.getvalue(), ".png"))])
        run.write_state(0, 0, mesh.points)
    found = []
    for shot in (Shot("front"), Shot("front", facets=True), Shot("front", cut="y=0.5")):
        red, green, blue = np.moveaxis(pixels(render(open_run(tmp_path / "run"), tmp_path / "a.png", shot=shot)), 2, 0)
        others = (np.maximum(green, blue), np.maximum(red, blue), np.maximum(red, green))
        found.append([mine - other > 60 for mine, other in zip((red, green, blue), others, strict=True)])
    (warm, green, blue), *plain = found
    assert blue.mean() > 0.05 and green.mean() > 0.05 and warm.mean() < 0.001
    assert np.nonzero(blue)[0].mean() < np.nonzero(green)[0].mean() - 20, "the upper half of the texture is above"
    for others in plain:
        assert others[0].mean() > 0.1 and others[1].mean() == others[2].mean() == 0.0


def test_shadows_are_darker_where_a_body_is_nearer():
    corners = np.array([[-0.2, -0.2, 0], [0.2, -0.2, 0], [0.2, 0.2, 0], [-0.2, 0.2, 0]])
    square = corners[[[0, 1, 2], [0, 2, 3]]]
    middle = []
    for height in (0.0, 0.1, 0.5):
        shadow = shadow_map(square + [0, 0, height], 1.0, 1.0, 100)
        assert shadow.shape == (100, 100) and shadow.min() >= 0 and shadow.max() < 1 and shadow[0, 0] < 0.02
        middle.append(shadow[50, 50])
    assert middle[0] > 1.2 * middle[1] > 1.2 * middle[2] > 0
    assert not shadow_map(np.zeros((0, 3, 3)), 1.0, 1.0, 20).any()


# ---- grids


@pytest.mark.parametrize(
    ("count", "size", "columns", "picture"),
    [
        (1, (960, 540), 1, (960, 476)),
        (5, (1920, 1080), 3, ((1920 - 2 * CELL_GAP) // 3, (1080 - CELL_GAP) // 2 - 64)),
        (5, (4000, 400), 5, None),
        (4, (300, 2000), 1, None),
    ],
)
def test_pictures_share_a_size_so_that_they_are_largest(count, size, columns, picture):
    grid = Grid(count, count, above=64).filling(size, 1.0)
    assert grid.columns == columns and picture in (None, grid.picture) and grid.size == size
    corners = {grid.corner(i) for i in range(count)}
    assert len(corners) == count and all(
        0 <= x <= size[0] - grid.picture[0] and 64 <= y <= size[1] - grid.picture[1] for x, y in corners
    )


def test_a_frame_draws_anew_only_what_has_changed(flat_run):
    run, drawn = open_run(flat_run), []

    class Drawing:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            drawn.append("closed")

        def picture(self, run, level, step, camera, colours):
            drawn.append((level.index, step))
            return Image.new("RGB", (20, 10), (step, 0, 0))

    panes = [Pane(run, run.levels[0]), Pane(run, run.levels[1]), Pane(None, None)]
    moments = [[(a, None), (b, None), (0, None)] for a, b in ((0, 0), (1, 0), (9, 1))]
    shown = [np.asarray(page) for page in frames(Drawing(), Grid(3, 3, (20, 10)), panes, moments)]
    assert drawn == [(0, 0), (1, 0), (0, 1), (0, 6), (1, 1), "closed"], "a level that ended keeps its last state"
    assert [tuple(page[5, [10, 38], 0]) for page in shown] == [(0, 0), (1, 0), (6, 1)]


# ---- time, size and options


def test_films_play_at_real_speed_whatever_the_rate(flat_run, solid_run):
    for dt, fps in ((0.01, 24.0), (0.04, 60.0), (1 / 60, 30.0), (0.001, 25.0)):
        last = round(1.0 / dt)
        steps = film_steps(0, last, dt, fps)
        assert len(steps) == int(fps) + 1 and steps[0] == 0 and steps[-1] == last
        assert all(abs(step * dt - k / fps) <= dt / 2 + 1e-9 for k, step in enumerate(steps)), "the nearest state"
    assert film_steps(10, 30, 0.01, 50.0) == list(range(10, 31, 2)) and film_steps(7, 7, 0.01, 24.0) == [7]
    rates = ((0.01, None, False), (0.1, None, False), (0.02, None, True), (0.01, 24.0, False), (0.01, 24.0, True))
    found = [film_rate(*words) for words in (*rates, (0.001, 120.0, True))]
    assert found == pytest.approx([100 / 3, 10.0, 25.0, 24.0, 25.0, 50.0]), "no state twice; hundredths in GIFs"
    steps = chosen_steps(open_run(flat_run).levels[0], 6)
    assert steps == sorted(set(steps)) and steps[0] == 0 and steps[-1] == 6 and len(steps) == 5, "both ends"
    assert chosen_steps(open_run(solid_run).levels[0], 3, 5, 1) == [1, 2, 3]


def test_files_have_the_size_rate_and_steps_asked_for(solid_run, tmp_path):
    imageio = pytest.importorskip("imageio.v2")
    draw = lambda name, words: command(["render", str(solid_run), "-o", str(tmp_path / name), *words.split()])
    draw("a.mp4", "--size 240x180 --fps 50")
    with imageio.get_reader(tmp_path / "a.mp4") as film:
        meta, count = film.get_meta_data(), sum(1 for _ in film)
    assert (meta["size"], meta["fps"], count) == ((240, 180), 50.0, 5), "0.08 s at 50 frames a second"
    draw("b.gif", "--frames 1:2 --levels 0 --fps 50")
    with Image.open(tmp_path / "b.gif") as film:
        assert (film.n_frames, film.size, film.info["duration"]) == (2, (960, 540), 20), "landscape, steps 1 and 2"
    draw("c.png", "--size 700x301 --frames 2:2 --levels 0 --turn 20")
    draw("d.png", "--size 700x301 --frames 2:2 --levels 0 --turn 20 --cut z=0.4")
    whole, cut = pixels(tmp_path / "c.png"), pixels(tmp_path / "d.png")
    assert whole.shape == (301, 700, 3) and np.abs(whole - cut).max() > 50
    assert picture(open_run(solid_run), steps=[1], levels=[0], width=90, camera="top").width == 132 + 90 + CELL_GAP


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--size", "700"], "give both"),
        (["--size", "ax9"], "--size: 'a'"),
        (["--size", "20x20"], "each side has"),
        (["--size", "301x200", "-o", "x.mp4"], "even numbers; take 300x200"),
        (["--size", "70x70"], "too small"),
        (["--fps", "24"], "fps = 24"),
        (["--fps", "-3", "-o", "x.mp4"], "fps = -3"),
        (["--frames", "3:99"], "there are steps 0:4"),
        (["--frames", "3:1"], "3:1"),
        (["--frames", "a"], "--frames: 'a'"),
        (["--camera", "follow:nobody"], "follow one of left, right"),
        (["--camera", "follow:nobody", "-o", "x.mp4"], "follow one of left, right"),
    ],
)
def test_a_wrong_option_is_one_line_and_exit_code_2(solid_run, tmp_path, monkeypatch, capsys, words, named):
    monkeypatch.chdir(tmp_path)
    assert command(["render", str(solid_run), *(["-o", "x.png"] if "-o" not in words else []), *words]) == 2
    err = capsys.readouterr().err
    assert named in err and err.count("\n") == 1 and not list(tmp_path.iterdir())
