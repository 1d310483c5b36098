"""What a picture frames, where a camera stands, and how it moves: on arrays and on small stored runs."""

import numpy as np
import pytest
from PIL import Image

import runs
from pdvol.cli import run as command
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.draw.camera import VIEW_ANGLE, camera_of_run, content_of_run
from pdvol.studio.draw.camera_path import cameras_of_run, smoothed_path
from pdvol.studio.draw.film import film_rate, film_steps
from pdvol.studio.draw.framing import Sample, core_box, framed_points, in_scene, outermost
from pdvol.studio.draw.layout import CELL_GAP, grid
from pdvol.studio.draw.picture import chosen_steps, picture, render
from pdvol.studio.draw.views import STANDARD_VIEW, View, read_view
from shapes import together

CUBE = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def seen(camera, points):
    """Places of points in a picture: 1 is its right or upper edge; and their depth in front of the camera [m]."""
    x, y, z = ((points - camera.focus) @ np.column_stack([camera.right, camera.up, camera.towards])).T
    depth = camera.distance - z
    half = depth * np.tan(np.radians(VIEW_ANGLE / 2))
    return x / (half * camera.aspect), y / half, depth


# ---- framing


def test_the_core_is_made_of_times_and_bodies():
    # Body 0 moves along x for 100 samples, bodies 1 to 4 rest; each body counts once, however many samples it has.
    moving = np.zeros((100, 3))
    moving[:, 0] = np.arange(100)
    rest = np.array([(0.0, y, 0.0) for y in (0.0, 1.0, 2.0, 3.0)])
    middles, bodies = np.concatenate([moving, rest]), np.repeat([0, 1, 2, 3, 4], [100, 1, 1, 1, 1])
    low, high = core_box(bodies, middles - 0.5, middles + 0.5)
    assert np.allclose(low, [-0.5, -0.5, -0.5]) and np.allclose(high, [0.5, 2.5, 0.5])
    low, high = core_box(bodies[:100], moving - 0.5, moving + 0.5)
    assert np.allclose([low[0], high[0]], [9.4, 89.6]), "10 % of the time on either side"


def test_a_body_that_falls_out_of_the_scene_is_framed_only_while_it_is_near():
    # Six cubes rest within 4 m around the origin, one falls for 2 s.
    rest = np.array([(x, y, 0.0) for x in (-1.5, 0.0, 1.5) for y in (-1.5, 1.5)])
    times = np.linspace(0.0, 2.0, 41)
    falling = np.column_stack([0 * times, 0 * times, -0.5 * 9.81 * times**2])
    samples = [Sample(i, CUBE + place) for i, place in enumerate(rest) for _ in times]
    samples += [Sample(6, CUBE + place) for place in falling]
    shown = in_scene(*(np.array([getattr(s, name) for s in samples]) for name in ("body", "low", "high")))
    near = falling[:, 2] >= -0.5 - 1.5 * 4.0  # the core's longest side is 4 m
    assert shown[: -len(times)].all() and (shown[-len(times) :] == near).all() and 0 < near.sum() < len(near)
    points = framed_points(samples, [])
    assert points[:, 2].min() >= -0.5 - 6.0 - 0.5 and np.ptp(points[:, 0]) == 4.0


def test_a_body_alone_is_framed_over_its_whole_fall_and_so_are_two_far_apart():
    samples = [Sample(0, CUBE + [0, 0, z]) for z in 10.0 - 9.81 / 2 * np.linspace(0, 1.4, 30) ** 2]
    points = framed_points(samples + 300 * samples[-1:], [])
    assert points[:, 2].max() == 10.5 and points[:, 2].min() == pytest.approx(10 - 4.905 * 1.96 - 0.5)
    assert np.ptp(framed_points([Sample(i, CUBE + [30.0 * i, 0, 0]) for i in range(2)], [])[:, 0]) == 31.0
    row = framed_points([Sample(i, CUBE + [2.0 * i, 0, 0]) for i in range(9)], [])
    assert np.ptp(row[:, 0]) == 17.0, "a row of equal distances"


def test_what_leaves_a_scene_of_few_bodies_is_the_shot():
    """A ball that an arm throws, and the load of a broken spring; one body of five that goes twice as far as all."""
    for body, flown in ((2, [6.0, 0.0, 0.0]), (3, [0.0, 0.0, -20.0]), (5, [4.0, 0.0, 0.0])):
        rest = [Sample(i, CUBE + [0.0, 0.7 * i, 0.0]) for i in range(body - 1)] * 21
        flying = [Sample(body, CUBE + np.multiply(flown, t)) for t in np.linspace(0.0, 1.0, 21)]
        points = framed_points([*rest, *flying], [])
        assert (points == CUBE[0] + flown).all(axis=1).any(), f"one of {body} bodies"


def test_obstacles_are_framed_whole_where_they_are_near_and_not_too_large():
    bodies = [Sample(0, CUBE), Sample(1, CUBE + [1.0, 0, 0])]
    collider = 1.2 * CUBE
    near, far = collider + [0, 0, 1.3], collider + [0, 0, 9.0]
    assert framed_points(bodies, [near])[:, 2].max() == pytest.approx(1.9), "no part of the keyed collider is cropped"
    assert framed_points(bodies, [near, far])[:, 2].max() == pytest.approx(1.9), "where it is far it does not count"
    floor = CUBE * [100, 100, 0.01]
    diagonal = np.linalg.norm([2.0, 1.0, 1.0])
    assert framed_points(bodies, [floor])[:, 0].max() == pytest.approx(1.5 + 0.3 * diagonal)


def test_the_outermost_points_of_a_ball_frame_it():
    ball = np.random.default_rng(3).normal(size=(20000, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    kept = outermost(ball)
    directions = np.random.default_rng(4).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    assert len(kept) < 200 and (kept @ directions.T).max(axis=0).min() > 0.96


def test_a_run_with_a_far_body_keeps_the_others_large(tmp_path):
    meshes = [together(*(runs.ball(3, 60, (0.6 * i, 0, 0), 0.25) for i in range(6)))]
    folder = stored(tmp_path / "run", meshes, [f"b{i}" for i in range(6)], 20, {5: (0, 0, -20.0)})
    run = open_run(folder)
    camera = camera_of_run(run, run.levels, range(21), ())
    assert camera.half_height < 3.5, "twenty metres of fall would need ten"


def stored(path, meshes, names, steps, velocities):
    """A run whose bodies move at constant velocities [m/s], with dt = 0.05 s."""
    info = {"scene": "moving", "dt": 0.05, "steps": steps, "method": "direct", "versions": {}, "parameters": {}}
    with runs.RunWriter.create(path, info, meshes, names) as run:
        for level, mesh in enumerate(meshes):
            for step in range(steps + 1):
                x = mesh.points.copy()
                for body, velocity in velocities.items():
                    x[mesh.point_bodies == body] += 0.05 * step * np.asarray(velocity)
                run.write_state(level, step, x, runs.record(level, step) if step else None)
            run.set_level_state(level, "done")
    return path


# ---- views


def test_named_views_look_along_the_axes():
    ways = {name: read_view(name) for name in ("front", "side", "top", "three-quarter")}
    assert (ways["front"].turn, ways["front"].rise, ways["side"].turn, ways["top"].rise) == (0.0, 0.0, 90.0, 90.0)
    assert read_view("") == STANDARD_VIEW and read_view("follow:left ball").body == "left ball"
    assert read_view("1,2,3:0,0,0.5") == View(position=(1.0, 2.0, 3.0), target=(0.0, 0.0, 0.5))


@pytest.mark.parametrize("text", ["back", "follow:", "1,2:0,0,0", "1,2,3", "1,2,nan:0,0,0", "1,1,1:1,1,1"])
def test_what_is_no_view_is_named_in_one_line(text):
    with pytest.raises(InputError, match="--camera") as error:
        read_view(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "towards", "up"),
    [("front", (0, -1, 0), (0, 0, 1)), ("side", (1, 0, 0), (0, 0, 1)), ("top", (0, 0, 1), (0, 1, 0))],
)
def test_all_content_is_within_the_picture_from_every_side(solid_run, name, towards, up):
    run = open_run(solid_run)
    for aspect in (None, 16 / 9, 0.5):
        camera = camera_of_run(run, run.levels, [0, 2, 4], run.obstacles, view=read_view(name), aspect=aspect)
        assert np.allclose(camera.towards, towards) and np.allclose(camera.up, up)
        assert aspect is None or camera.aspect == aspect
        x, y, depth = seen(camera, content_of_run(run.levels, [0, 2, 4], run.obstacles))
        assert depth.min() > 0 and 0.8 < max(abs(x).max(), abs(y).max()) <= 1.0


def test_a_position_and_a_target_are_the_cameras(solid_run):
    run = open_run(solid_run)
    view = read_view("-4,-6,3:0,0,1")
    (camera,) = cameras_of_run(run, run.levels, [2], run.obstacles, view=view)
    assert np.allclose(camera.position, (-4, -6, 3)) and np.allclose(camera.focus, (0, 0, 1))
    assert abs(camera.right[2]) < 1e-12 and camera.up[2] > 0.8, "upright"
    assert np.linalg.det(np.column_stack([camera.right, camera.up, camera.towards])) == pytest.approx(1.0)


def test_a_flat_scene_has_one_view(flat_run, tmp_path):
    run = open_run(flat_run)
    for choice in ({"view": "side"}, {"view": "0,0,3:0,0,0"}):
        with pytest.raises(InputError, match="2D"):
            render(run, tmp_path / "x.png", **choice)
    assert render(run, tmp_path / "x.png", steps=[0, 3], cell_width=100, view="follow:left").exists()


# ---- moving cameras


def test_the_followed_body_stays_in_the_picture_and_the_others_leave_it(tmp_path):
    meshes = [together(*(runs.ball(3, n, (0, 1.5 * i, 0), 0.3) for i in range(2))) for n in (60, 150)]
    run = open_run(stored(tmp_path / "run", meshes, ["stays", "goes"], 40, {1: (3.0, 0, 1.0)}))
    cameras = cameras_of_run(run, run.levels, range(41), (), view=read_view("follow:goes"), aspect=1.5)
    assert len({camera.distance for camera in cameras}) == 1
    for step, camera in enumerate(cameras):
        mine = run.levels[1].positions(step)[run.levels[1].mesh.point_bodies == 1]
        x, y, _ = seen(camera, mine)
        assert max(abs(x).max(), abs(y).max()) < 1.0 and abs(x.mean()) < 0.1 and abs(y.mean()) < 0.1
    others = run.levels[1].positions(40)[run.levels[1].mesh.point_bodies == 0]
    assert abs(seen(cameras[-1], others)[0]).min() > 1.0
    with pytest.raises(InputError, match="no body 'gone'; follow one of stays, goes"):
        cameras_of_run(run, run.levels, [0], (), view=read_view("follow:gone"))


def test_smoothing_keeps_straight_paths_and_softens_impacts():
    straight = np.arange(30.0)[:, None] * [1.0, 0.0, -2.0]
    assert np.allclose(smoothed_path(straight, 4.0), straight)
    bounce = np.abs(np.arange(-20.0, 21.0))[:, None] * [0.0, 0.0, 1.0]
    smooth = smoothed_path(bounce, 3.0)
    turn = np.abs(np.diff(smooth[:, 2], 2)).max()
    assert turn < 0.3 < np.abs(np.diff(bounce[:, 2], 2)).max() == 2.0
    assert smoothed_path(bounce, 0.5) is bounce and len(smoothed_path(bounce[:1], 9.0)) == 1


# ---- films: time and size


def test_films_play_at_real_speed_whatever_the_rate():
    for dt, fps in ((0.01, 24.0), (0.04, 60.0), (1 / 60, 30.0), (0.001, 25.0)):
        last = round(1.0 / dt)
        steps = film_steps(0, last, dt, fps)
        assert len(steps) == int(fps) + 1 and steps[0] == 0 and steps[-1] == last
        assert all(abs(step * dt - k / fps) <= dt / 2 + 1e-9 for k, step in enumerate(steps)), "the nearest state"
    assert film_steps(10, 30, 0.01, 50.0) == list(range(10, 31, 2)) and film_steps(7, 7, 0.01, 24.0) == [7]


def test_rates_without_a_wish_leave_no_state_twice_and_gifs_have_whole_hundredths():
    assert film_rate(0.01) == pytest.approx(100 / 3) and film_rate(0.1) == pytest.approx(10.0)
    assert film_rate(0.02, gif=True) == 25.0
    assert film_rate(0.01, 24.0) == 24.0 and film_rate(0.01, 24.0, gif=True) == 25.0
    assert film_rate(0.001, 120.0, gif=True) == 50.0


def test_a_film_has_the_size_rate_and_steps_asked_for(solid_run, tmp_path):
    imageio = pytest.importorskip("imageio.v2")
    command(["render", str(solid_run), "-o", str(tmp_path / "a.mp4"), "--size", "240x180", "--fps", "50"])
    with imageio.get_reader(tmp_path / "a.mp4") as film:
        meta, frames = film.get_meta_data(), [np.asarray(frame) for frame in film]
    assert (meta["size"], meta["fps"]) == ((240, 180), 50.0)
    assert len(frames) == 5, "0.08 s at 50 frames a second"
    command(
        ["render", str(solid_run), "-o", str(tmp_path / "b.gif"), "--frames", "1:2", "--levels", "0", "--fps", "50"]
    )
    with Image.open(tmp_path / "b.gif") as film:
        assert (film.n_frames, film.size, film.info["duration"]) == (2, (960, 540), 20), "landscape, steps 1 and 2"


def test_pictures_have_the_size_and_steps_asked_for(solid_run, tmp_path):
    command(["render", str(solid_run), "-o", str(tmp_path / "a.png"), "--size", "700x301", "--frames", "1:3"])
    with Image.open(tmp_path / "a.png") as drawn:
        assert drawn.size == (700, 301)
    assert picture(open_run(solid_run), steps=[1], levels=[0], width=90, camera="top").size[0] == 132 + 90 + CELL_GAP
    assert chosen_steps(open_run(solid_run).levels[0], 3, 5, 1) == [1, 2, 3]


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
    ],
)
def test_a_wrong_option_is_one_line_and_exit_code_2(solid_run, tmp_path, monkeypatch, capsys, words, named):
    monkeypatch.chdir(tmp_path)
    assert command(["render", str(solid_run), *(["-o", "x.png"] if "-o" not in words else []), *words]) == 2
    err = capsys.readouterr().err
    assert named in err and err.count("\n") == 1 and not list(tmp_path.iterdir())


def test_cells_share_a_size_so_that_they_are_largest():
    assert grid(1, (960, 540), 1.0, 64) == (1, (960, 476))
    columns, (width, height) = grid(5, (1920, 1080), 1.0, 64)
    assert columns == 3 and width == (1920 - 2 * CELL_GAP) // 3 and height == (1080 - CELL_GAP) // 2 - 64
    assert grid(5, (4000, 400), 1.0, 64)[0] == 5 and grid(4, (300, 2000), 1.0, 64)[0] == 1
