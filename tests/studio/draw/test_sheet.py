"""Contact sheets, their films and scatters: nothing of a label is lost, every tile is there, failed ones too."""

import shutil

import numpy as np
import pytest
from PIL import Image

import runs
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.draw.layout import BACKGROUND, font
from pdvol.studio.draw.plots import scatter_image
from pdvol.studio.draw.sheet import (
    LEAST_LABEL_SIZE,
    MOST_PICTURES,
    NARROWEST_TILE,
    WIDEST_FILM,
    WIDEST_SHEET,
    Tile,
    cluster_name,
    film_times,
    shared_camera,
    sheet_film,
    sheet_grid,
    sheet_image,
    wrapped,
)
from pdvol.studio.wedge.results import scored_bodies
from pdvol.studio.wedge.results import tiles as result_tiles

REASON = "level 0, step 3 could not be solved: Newton's method did not converge"


@pytest.fixture
def tiles(flat_run):
    run = open_run(flat_run)
    lines = ["offset 0.0125", "surface models/a_rather_long_name_of_a_cow_on_a_meadow_in_spring.obj", "upright 0.97"]
    return [
        Tile("0", lines, run, cluster=0),
        Tile("1", lines[:1], None, REASON),
        Tile("2", lines, run, "stopped at 0.1 s", cluster=1),
        Tile("3", [], None),
    ]


def pictures(path, tiles):
    """The pictures and the labels of a sheet's tiles, as arrays."""
    grid = sheet_grid(tiles, shared_camera(tiles).aspect)
    sheet, (width, height) = np.asarray(Image.open(path).convert("RGB"), dtype=int), grid.picture
    assert sheet.shape[:2] == grid.size[::-1]
    corners = [grid.corner(i) for i in range(len(tiles))]
    shown = [sheet[y : y + height, x : x + width] for x, y in corners]
    return shown, [sheet[y + height + 4 : y + height + grid.below, x : x + width] for x, y in corners]


def test_every_tile_is_drawn_and_its_picture_also_written_alone(tiles, tmp_path):
    path = sheet_image(tiles, tmp_path / "new" / "sheet.png", apart=tmp_path / "tiles")
    shown, labels = pictures(path, tiles)
    warm = [(part[..., 0] - part[..., 2] > 60).sum() for part in shown]
    assert warm[0] > 2000 and warm[2] > 2000, "the apricot body"
    assert warm[1] == warm[3] == 0, "no body where nothing is stored"
    dark = [(part.sum(axis=2) < 350).sum() for part in shown]
    assert dark[1] > 300 and dark[3] > 50, "the reason is written there"
    letters = [(part.sum(axis=2) < 350).sum() for part in labels]
    assert letters[0] > letters[1] > letters[3] > 0
    assert [cluster_name(i) for i in (0, 25, 26, 52)] == ["group A", "group Z", "group AA", "group BA"]
    assert sorted(file.name for file in (tmp_path / "tiles").iterdir()) == ["0.png", "2.png"]
    assert np.array_equal(np.asarray(Image.open(tmp_path / "tiles" / "0.png").convert("RGB")), shown[0])
    failed = sheet_image([Tile("0", ["spin 2"], None, REASON)], tmp_path / "sheet.png")
    assert len(Image.open(failed).convert("RGB").getcolors(1 << 20)) > 3


def test_no_character_of_a_label_is_lost():
    lines = ["surface models/a_rather_long_name_of_a_cow.obj with  words", "x" * 300, "", "spin 2"]
    rows = wrapped(lines, 200, 14)
    assert "".join("".join(rows).split()) == "".join("".join(lines).split())
    assert all(font(14).getlength(row) <= 200 for row in rows)
    assert "spin 2" in rows


@pytest.mark.parametrize("aspect", [0.62, 1.5])
@pytest.mark.parametrize("count", [1, 4, 20, 100])
def test_sheets_of_1_to_100_tiles(count, aspect):
    tiles = [Tile(str(i), ["offset 0.0125", "spin 3", "upright 0.97"], None) for i in range(count)]
    grid = sheet_grid(tiles, aspect)
    (width, height), rows = grid.size, -(-count // grid.columns)
    assert width <= WIDEST_SHEET and 0.4 < width / height < 3.5
    assert grid.columns * rows >= count > grid.columns * (rows - 1)
    assert grid.picture[0] >= NARROWEST_TILE and grid.below >= 4 * 1.3 * LEAST_LABEL_SIZE - 2
    corners = {grid.corner(i) for i in range(count)}
    assert len(corners) == count and max(y for _, y in corners) + grid.picture[1] + grid.below <= height


def test_one_stray_does_not_make_all_small_but_a_body_that_a_score_names_is_in_each_picture(tmp_path, flat_run):
    """The throw that goes furthest is the best one, and one of ten."""
    for name, way in (("stray", 1000.0), ("far", 9.0)):
        shutil.copytree(flat_run, tmp_path / name)
        folder = tmp_path / name / "levels" / "1"
        runs.put_state(folder, 6, runs.states_of(folder).read(6) + [way, 0.0])
    tiles = [Tile(str(i), [], open_run(flat_run)) for i in range(12)]
    near, stray = shared_camera(tiles).half_height, Tile("stray", [], open_run(tmp_path / "stray"))
    assert shared_camera([*tiles, stray]).half_height < 1.5 * near < 50 * near < shared_camera([stray]).half_height
    entries = [
        {"number": i, "changes": {}, "scores": {'far("right")': i}, "state": "done", "reason": "", "cluster": -1}
        for i in range(10)
    ]
    drawn = result_tiles(entries, [open_run(path) for path in [*[flat_run] * 9, tmp_path / "far"]])
    camera, level = shared_camera(drawn), drawn[-1].run.levels[1]
    right = level.positions(6)[level.mesh.point_bodies == 1]
    assert np.abs((right - camera.focus[:2]) @ camera.right[:2]).max() < camera.half_height * camera.aspect
    assert scored_bodies(['upright("a")', "meets('b', \"floor\")"], ["a", "b", "c"]) == ["a", "b"]
    assert scored_bodies(['upright("a")', "quiet()"], "abc") == ["a", "b", "c"] and scored_bodies([], "ab") == []


@pytest.mark.parametrize(
    ("call", "count", "name", "message"),
    [
        (sheet_image, 0, "sheet.png", "1 to 400 tiles"),
        (sheet_image, 4, "sheet.jpg", "ends in .png"),
        (sheet_film, 4, "sheet.avi", "ends in .gif, .mp4, .webp"),
    ],
)
def test_what_cannot_be_drawn(tiles, tmp_path, call, count, name, message):
    with pytest.raises(InputError, match=message):
        call(tiles[:count], tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_the_film_moves_and_keeps_its_labels(tiles, tmp_path):
    imageio = pytest.importorskip("imageio.v2")
    with imageio.get_reader(sheet_film(tiles, tmp_path / "sheet.mp4")) as film:
        frames = [np.asarray(frame).astype(int) for frame in film]
    assert len(frames) == 5  # 0.12 s of motion, 30 frames a second at most: moments 0.03 s apart, both ends included
    grid = sheet_grid(tiles, shared_camera(tiles).aspect, WIDEST_FILM)
    changed = (abs(frames[0] - frames[-1]).max(axis=2) > 60).nonzero()
    assert len(changed[0]) and changed[0].max() < grid.corner(0)[1] + grid.picture[1] + grid.below, "no label changes"
    moments, rate = film_times(tiles)
    assert len(moments) == 5 and rate == pytest.approx(4 / 0.12)
    many, slower = film_times(tiles[:1] * (MOST_PICTURES // 2))
    assert len(many) == 3 and many[-1] == moments[-1] and slower == pytest.approx(2 / 0.12), "long films are bounded"


def test_scatter(tmp_path):
    values = {"speed": [1, 2.5, 3], "surface": ["a.obj", "b.obj", "a.obj"]}
    scores = {"upright": [0.1, None, 0.9], "quiet": [float("nan")] * 3}
    image = Image.open(scatter_image(values, scores, ["0", "1", "2"], tmp_path / "new" / "scatter.png")).convert("RGB")
    assert image.width > 600 and image.height > 600
    rgb = np.asarray(image, dtype=int)
    assert (rgb[..., 0] - rgb[..., 2] > 60).sum() > 50, "the best variation, apricot"
    assert BACKGROUND == "#{:02x}{:02x}{:02x}".format(*rgb[0, 0])
    with pytest.raises(InputError, match="speed has 3 values for 2 variations"):
        scatter_image(values, scores, ["0", "1"], tmp_path / "scatter.png")
    with pytest.raises(InputError, match="needs a parameter"):
        scatter_image({}, scores, ["0", "1", "2"], tmp_path / "scatter.png")
