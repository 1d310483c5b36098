"""Pictures are drawn without a display and without output on the terminal, and they are not empty."""

import importlib.util
import os
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import runs
from commands import SAFETY
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.draw.contact_shadows import shadow_map
from pdvol.studio.draw.picture import chosen_steps, render


@pytest.mark.parametrize("kind", ["flat_run", "solid_run"])
def test_a_picture_shows_the_bodies(kind, request, tmp_path):
    path = render(
        open_run(request.getfixturevalue(kind)), tmp_path / "new" / "run.png", steps=[0, 2, 4], cell_width=200
    )
    image = Image.open(path)
    assert image.width > 3 * 200 and image.height > 2 * 120
    assert len(image.convert("RGB").getcolors(1 << 24)) > 500
    rgb = np.asarray(image.convert("RGB"), dtype=int)
    warm, cool = (rgb[..., 0] - rgb[..., 2] > 60).mean(), (rgb[..., 2] - rgb[..., 0] > 40).mean()
    assert warm > 0.01 and cool > 0.01, "both bodies, apricot and teal"


def test_no_display_and_no_word(solid_run, tmp_path):
    code = f"""
from pdvol.studio.draw.picture import render
from pdvol.store.reader import open_run
render(open_run({str(solid_run)!r}), {str(tmp_path / "run.png")!r}, levels=[0], steps=[1], cell_width=120)
"""
    for display in ({}, {"DISPLAY": ":77"}):
        env = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")} | display
        done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=SAFETY)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_an_unfinished_run_is_drawn(small_run, tmp_path):
    runs.keep_states(small_run / "levels" / "1", 2)
    run = open_run(small_run)
    assert render(run, tmp_path / "run.png", cell_width=100).exists()
    with pytest.raises(InputError, match="steps to draw must lie between 0 and 6"):
        render(run, tmp_path / "run.png", steps=[9])
    with pytest.raises(InputError, match="no stored state of level 4"):
        render(run, tmp_path / "run.png", levels=[4])
    with pytest.raises(InputError, match="ends in .png, .gif, .mp4, .webp"):
        render(run, tmp_path / "run.bmp")


@pytest.mark.parametrize("ending", ["gif", "mp4"])
def test_films(flat_run, tmp_path, ending):
    imageio = pytest.importorskip("imageio.v2")
    path = render(open_run(flat_run), tmp_path / f"run.{ending}", cell_width=120)
    with imageio.get_reader(path) as film:
        frames = [np.asarray(frame) for frame in film]
    assert len(frames) == 4  # 7 states, every second one: 25 frames a second
    assert frames[0].shape[1] > 2 * 120 and (frames[0] != frames[-1]).any()
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_films_that_pages_show_like_a_picture(flat_run, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    path = render(open_run(flat_run), tmp_path / "run.webp", cell_width=120)
    with Image.open(path) as film:
        assert (film.format, film.n_frames, film.info["loop"]) == ("WEBP", 4, 0)
        first = np.asarray(film.convert("RGB"), dtype=int)
        film.seek(3)
        last = np.asarray(film.convert("RGB"), dtype=int)
        assert film.info["duration"] in (40, 41)  # 25 frames a second
        assert first.shape[1] > 2 * 120 and (abs(last - first) > 60).any()
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_a_missing_extra_is_named(flat_run, tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'pdvol\[film\]'"):
        render(open_run(flat_run), tmp_path / "run.mp4")
    assert not list(tmp_path.iterdir())


def test_chosen_steps_hold_both_ends(flat_run):
    steps = chosen_steps(open_run(flat_run).levels[0], 6)
    assert steps == sorted(set(steps)) and steps[0] == 0 and steps[-1] == 6 and len(steps) == 5


def test_shadows_are_darker_where_a_body_is_nearer():
    square = np.array(
        [[[-0.2, -0.2, 0], [0.2, -0.2, 0], [0.2, 0.2, 0]], [[-0.2, -0.2, 0], [0.2, 0.2, 0], [-0.2, 0.2, 0]]],
        dtype=float,
    )
    middle = []
    for height in (0.0, 0.1, 0.5):
        shadow = shadow_map(square + [0, 0, height], 1.0, 1.0, 100)
        assert shadow.shape == (100, 100) and shadow.min() >= 0 and shadow.max() < 1 and shadow[0, 0] < 0.02
        middle.append(shadow[50, 50])
    assert middle[0] > 1.2 * middle[1] > 1.2 * middle[2] > 0
    assert not shadow_map(np.zeros((0, 3, 3)), 1.0, 1.0, 20).any()
