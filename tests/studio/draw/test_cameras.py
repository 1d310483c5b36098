"""What a picture frames, where a camera stands, and how it moves: on arrays and on small stored runs."""

import numpy as np
import pytest

import runs
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.draw.camera import VIEW_ANGLE, cameras_of_run, content_of_run, smoothed_path
from pdvol.studio.draw.framing import core_box, framed_points, in_scene, outermost
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
    places, bodies = np.concatenate([np.repeat(rest, len(times), axis=0), falling]), np.repeat(range(7), len(times))
    shown = in_scene(bodies, places - 0.5, places + 0.5)
    near = falling[:, 2] >= -0.5 - 1.5 * 4.0  # the core's longest side is 4 m
    assert shown[: -len(times)].all() and (shown[-len(times) :] == near).all() and 0 < near.sum() < len(near)
    points = framed_points(bodies, [CUBE + place for place in places], [])
    assert points[:, 2].min() >= -0.5 - 6.0 - 0.5 and np.ptp(points[:, 0]) == 4.0


def row(count, distance):
    """Bodies and samples of cubes at equal distances along x."""
    return [*range(count)], [CUBE + [distance * i, 0.0, 0.0] for i in range(count)]


def flight(count, way):
    """All but one of so many bodies rest in a row, the last one moves along `way` and then rests at its start."""
    rest = [CUBE + [0.0, 0.7 * i, 0.0] for i in range(count - 1)]
    moving = [CUBE + np.multiply(way, t) for t in np.linspace(0.0, 1.0, 21)] + 9 * [CUBE]
    return [*range(count - 1)] * 30 + [count] * 30, rest * 30 + moving


@pytest.mark.parametrize(
    ("samples", "axis", "low", "high"),
    [
        pytest.param(flight(1, [0, 0, -9.6]), 2, -10.1, 0.5, id="the fall of one"),
        pytest.param(row(2, 30.0), 0, -0.5, 30.5, id="two far from each other"),
        pytest.param(row(9, 2.0), 0, -0.5, 16.5, id="a row of equal distances"),
        pytest.param(flight(2, [6.0, 0, 0]), 0, -0.5, 6.5, id="a ball that an arm throws"),
        pytest.param(flight(3, [0, 0, -20.0]), 2, -20.5, 0.5, id="the load of a broken spring"),
        pytest.param(flight(5, [4.0, 0, 0]), 0, -0.5, 4.5, id="one of five that goes twice as far as all"),
    ],
)
def test_what_is_the_shot_is_framed(samples, axis, low, high):
    points = framed_points(*samples, [])[:, axis]
    assert (points.min(), points.max()) == pytest.approx((low, high))


@pytest.mark.parametrize(
    ("obstacles", "axis", "high"),
    [
        pytest.param([1.2 * CUBE + [0, 0, 1.3]], 2, 1.9, id="no part of a near one is cropped"),
        pytest.param([1.2 * CUBE + [0, 0, z] for z in (1.3, 9.0)], 2, 1.9, id="where it is far it does not count"),
        pytest.param([CUBE * [100, 100, 0.01]], 0, 1.5 + 0.3 * 6.0**0.5, id="a part of a large one"),
    ],
)
def test_obstacles_are_framed_where_they_are_near(obstacles, axis, high):
    assert framed_points(*row(2, 1.0), obstacles)[:, axis].max() == pytest.approx(high)


def test_the_outermost_points_of_a_ball_frame_it():
    ball, directions = (np.random.default_rng(seed).normal(size=(n, 3)) for seed, n in ((3, 20000), (4, 500)))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    kept = outermost(ball)
    assert len(kept) < 200 and (kept @ directions.T).max(axis=0).min() > 0.96


# ---- views


@pytest.mark.parametrize(
    ("text", "view"),
    [
        ("", STANDARD_VIEW),
        ("front", View(0.0, 0.0)),
        ("top", View(0.0, 90.0)),
        ("follow:left ball", View(body="left ball")),
        ("1,2,3:0,0,0.5", View(position=(1.0, 2.0, 3.0), target=(0.0, 0.0, 0.5))),
        *((text, None) for text in ("back", "follow:", "1,2:0,0,0", "1,2,3", "1,2,nan:0,0,0", "1,1,1:1,1,1")),
    ],
)
def test_texts_of_views(text, view):
    if view is not None:
        assert read_view(text) == view and read_view(text, 10.0).turn == view.turn + 10.0
        return
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
        camera = cameras_of_run(run, run.levels, [0, 2, 4], read_view(name), aspect)[0]
        assert np.allclose(camera.towards, towards) and np.allclose(camera.up, up)
        assert aspect is None or camera.aspect == aspect
        x, y, depth = seen(camera, content_of_run(run.levels, [0, 2, 4], run.obstacles))
        assert depth.min() > 0 and 0.8 < max(abs(x).max(), abs(y).max()) <= 1.0


def test_a_position_and_a_target_are_the_cameras_and_a_flat_scene_has_one_view(solid_run, flat_run):
    run = open_run(solid_run)
    for place in ((-4, -6, 3), (0, 0, 9)):
        (camera,) = cameras_of_run(run, run.levels, [2], View(position=place, target=(0, 0, 1)))
        assert np.allclose(camera.position, place) and np.allclose(camera.focus, (0, 0, 1))
        assert abs(camera.right[2]) < 1e-12 and (camera.up[2] > 0.8 or place[0] == 0), "upright"
        assert np.linalg.det(np.column_stack([camera.right, camera.up, camera.towards])) == pytest.approx(1.0)
    run = open_run(flat_run)
    for view in ("side", "top", "0,0,3:0,0,0"):
        with pytest.raises(InputError, match="2D"):
            cameras_of_run(run, run.levels, [0], read_view(view))
    assert len(cameras_of_run(run, run.levels, [0, 3], read_view("follow:left", 30.0))) == 2


# ---- moving cameras


def test_the_followed_body_stays_in_the_picture_and_the_others_leave_it(tmp_path):
    """A ball rests and one goes, both on two levels, with steps of 0.05 s."""
    meshes = [together(*(runs.ball(3, n, (0, 1.5 * i, 0), 0.3) for i in range(2))) for n in (60, 150)]
    with runs.RunWriter.create(tmp_path / "run", {"dt": 0.05, "steps": 40}, meshes, ["stays", "goes"]) as writer:
        for level, mesh in enumerate(meshes):
            for step in range(41):
                goes = mesh.point_bodies[:, None] * np.array([0.15, 0.0, 0.05])
                writer.write_state(level, step, mesh.points + step * goes, runs.record(level, step) if step else None)
    run = open_run(tmp_path / "run")
    cameras = cameras_of_run(run, run.levels, range(41), read_view("follow:goes"), aspect=1.5)
    assert len({camera.distance for camera in cameras}) == 1
    for step, camera in enumerate(cameras):
        mine = run.levels[1].positions(step)[run.levels[1].mesh.point_bodies == 1]
        x, y, _ = seen(camera, mine)
        assert max(abs(x).max(), abs(y).max()) < 1.0 and abs(x.mean()) < 0.1 and abs(y.mean()) < 0.1
    others = run.levels[1].positions(40)[run.levels[1].mesh.point_bodies == 0]
    assert abs(seen(cameras[-1], others)[0]).min() > 1.0
    with pytest.raises(InputError, match="no body 'gone'; follow one of stays, goes"):
        cameras_of_run(run, run.levels, [0], read_view("follow:gone"))


def test_smoothing_keeps_straight_paths_and_softens_impacts():
    straight = np.arange(30.0)[:, None] * [1.0, 0.0, -2.0]
    assert np.allclose(smoothed_path(straight, 4.0), straight)
    bounce = np.abs(np.arange(-20.0, 21.0))[:, None] * [0.0, 0.0, 1.0]
    smooth = smoothed_path(bounce, 3.0)
    turn = np.abs(np.diff(smooth[:, 2], 2)).max()
    assert turn < 0.3 < np.abs(np.diff(bounce[:, 2], 2)).max() == 2.0
    assert smoothed_path(bounce, 0.5) is bounce and len(smoothed_path(bounce[:1], 9.0)) == 1
