"""What is drawn of a stored state."""

import dataclasses

import numpy as np
import pytest

from pdvol.store.obstacles import write_obstacles
from pdvol.store.reader import open_run
from pdvol.studio.draw.layout import rgb
from pdvol.studio.live.frames import Frames, same_topology, view
from pdvol.studio.shown import PALETTE


@pytest.mark.parametrize("name, dim", [("flat_run", 2), ("solid_run", 3)])
def test_bodies_are_at_their_stored_positions_in_their_colours(name, dim, request):
    run = open_run(request.getfixturevalue(name))
    camera = view(run)
    for index, level in enumerate(run.levels):
        frames = Frames(run, index, camera.size, camera.focus)
        shapes = {shape.name: shape for shape in frames.at(2)}
        for body in np.unique(level.bodies):
            shape = shapes[f"body {body}"]
            assert shape.colour == rgb(PALETTE[body]) and shape.lit == (dim == 3)
            facets = level.cells[level.bodies == body]
            if dim == 3:
                facets = level.surface[level.mesh.point_bodies[level.surface[:, 0]] == body]
            drawn, stored = shape.points[shape.faces], level.positions(2)[facets]
            np.testing.assert_allclose(drawn[..., :dim], stored, rtol=0, atol=1e-6)
        assert same_topology(frames.at(1), frames.at(2)) and len(run.obstacles) > 0
        assert any(shape.name.startswith("obstacle") for shape in shapes.values())


def test_a_moving_obstacle_moves(solid_run):
    run = open_run(solid_run)
    camera = view(run)
    frames = Frames(run, 0, camera.size, camera.focus)
    first, last = ({shape.name: shape.points for shape in frames.at(step)} for step in (0, run.levels[0].steps - 1))
    number = next(i for i, obstacle in enumerate(run.obstacles) if "positions" in obstacle.arrays)
    moved = run.obstacles[number].vertices(run.levels[0].steps - 1)
    np.testing.assert_allclose(last[f"obstacle {number}"], moved, atol=1e-6)
    assert not np.allclose(first[f"obstacle {number}"], last[f"obstacle {number}"])


def test_outlines_of_2d_obstacles_are_filled_where_they_can_be(small_run):
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.2], [0.0, 1.0]])
    ring = np.column_stack([np.arange(5), (np.arange(5) + 1) % 5])
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    star = np.column_stack([np.cos(angle), np.sin(angle)]) * (1 + 0.5 * np.sin(60 * angle))[:, None]
    loop = np.column_stack([np.arange(400), (np.arange(400) + 1) % 400])
    write_obstacles(
        small_run,
        [
            {"name": "notch", "kind": "polyline", "vertices": corners, "edges": ring},
            {"name": "open", "kind": "polyline", "vertices": corners, "edges": ring[:-1]},
            {"name": "star", "kind": "polyline", "vertices": star, "edges": loop},
        ],
    )
    run = open_run(small_run)
    shapes = {shape.name: shape for shape in Frames(run, 0, 1.0, np.zeros(3)).at(0)}
    filled = shapes["obstacle 0"]
    a, b, c = (filled.points[filled.faces[:, i], :2] for i in range(3))
    areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert abs(areas.sum() - 0.6) < 1e-6 and (areas > 0).all()  # shoelace: the square less a triangle of 1 x 0.8 / 2
    assert "obstacle 1" not in shapes and "obstacle 1 outline" in shapes
    assert "obstacle 2" not in shapes and len(shapes["obstacle 2 outline"].faces) == 400


def test_frames_of_other_shapes_are_not_taken_for_moved_ones(flat_run):
    run = open_run(flat_run)
    one, other = (Frames(run, level, 1.0, np.zeros(3)).at(0) for level in (0, 1))
    assert not same_topology(one, other)
    assert not same_topology(one, one[:-1])
    assert not same_topology(one, [dataclasses.replace(one[0], colour=(1, 2, 3)), *one[1:]])


def test_the_view_holds_bodies_and_what_is_below_them(solid_run):
    run = open_run(solid_run)
    camera = view(run)
    points = run.levels[0].positions(0)
    across = (points - camera.focus) @ np.column_stack([camera.right, camera.up])
    assert np.abs(across[:, 1]).max() <= camera.half_height and np.abs(across[:, 0]).max() <= (
        camera.half_height * camera.aspect
    )
