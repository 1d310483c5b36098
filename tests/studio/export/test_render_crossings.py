"""Depths of crossings that are known by hand: boxes whose render meshes are larger than what is simulated."""

from dataclasses import replace

import numpy as np
import pytest

from pdvol.store.obstacles import write_obstacles
from pdvol.store.reader import open_run
from pdvol.store.writer import RunWriter
from pdvol.studio.export.exports import export_run
from pdvol.studio.export.render_crossings import deepest_crossing, rest_gaps
from rendered import entry_of, grown_box, write_render_meshes
from shapes import box, together

LARGER = 0.005  # m: how far the render meshes stand out
GAP = 0.002  # m: between simulated surfaces, and above the plane at the start


def stored(path, heights, obstacles=(), meshes=None, closed=True):
    """A run of two boxes of 1 m beside each other, that stand at these heights [m] in its steps."""
    mesh = together(box(3, 3), box(3, 3, (1.0 + GAP, 0.0, 0.0), (2.0 + GAP, 1.0, 1.0)))
    info = {"dt": 0.1, "steps": len(heights) - 1}
    with RunWriter.create(path, info, [mesh], ["left", "right"]) as run:
        write_obstacles(
            run.path, [{"name": "floor", "kind": "plane", "point": [0, 0, -GAP], "normal": [0, 0, 1.0]}, *obstacles]
        )
        surfaces = meshes or {0: grown_box(0.0, 1.0, LARGER)}
        write_render_meshes(run.path, [entry_of(mesh, body, surface) for body, surface in surfaces.items()])
        for step, height in enumerate(heights):
            run.write_state(0, step, mesh.points + [0.0, 0.0, height])
    return open_run(path)


def test_a_box_5_mm_larger_on_a_plane(tmp_path):
    """Depth, step and obstacle are named; the simulated surface crosses nothing."""
    run = stored(tmp_path / "run", [0.1, 0.0, 0.001], meshes={0: grown_box((0, 0, 0), (0.99, 1, 1), LARGER)})
    worst = deepest_crossing(run, run.levels[0])
    assert (worst.name, worst.other, worst.step) == ("left", "plane 'floor'", 1)
    assert worst.depth == pytest.approx(LARGER - GAP, abs=1e-12)
    out, within = rest_gaps(run.levels[0], run.render_meshes[0])
    assert out == pytest.approx(LARGER * np.sqrt(3), abs=1e-9) and within == pytest.approx(0.01 - LARGER, abs=1e-9)
    _, notes = export_run(run.path, "obj", tmp_path / "out")
    assert notes[1] == "level 0: render meshes cross by up to 0.003 m: 'left' and plane 'floor' at step 1"
    assert export_run(run.path, "obj", tmp_path / "out", surface="contact")[1] == []


def test_two_render_meshes(tmp_path):
    """Both stand out by 5 mm into a gap of 2 mm: each reaches 8 mm into the other."""
    both = {0: grown_box(0.0, 1.0, LARGER), 1: grown_box((1.0 + GAP, 0, 0), (2.0 + GAP, 1, 1), LARGER)}
    run = stored(tmp_path / "run", [0.1], meshes=both)
    worst = deepest_crossing(run, run.levels[0])
    assert worst.other == "body 'right'" and worst.depth == pytest.approx(2 * LARGER - GAP, abs=1e-9)


def test_an_obstacle_that_is_smaller_than_a_face(tmp_path):
    """Its corners are within the render mesh, none of whose own vertices are within it."""
    corners = box(3, 1, (0.4, 0.4, 1.0 + GAP), (0.6, 0.6, 1.5))
    block = {"name": "block", "kind": "mesh", "vertices": corners.points, "faces": corners.boundary}
    run = stored(tmp_path / "run", [0.0005], [block], {0: grown_box((0, 0, 0.1), (0.9, 1, 1), LARGER, 1)})
    worst = deepest_crossing(run, run.levels[0])
    assert worst.other == "obstacle 'block'" and worst.depth == pytest.approx(LARGER - GAP + 0.0005, abs=1e-9)


def test_nothing_crosses(tmp_path):
    """A vertex without a face, which is not drawn, is far below the plane."""
    surface = grown_box(0.1, 0.9, 0.0)
    surface = replace(surface, vertices=np.vstack([surface.vertices, [0.5, 0.5, -3.0]]))
    run = stored(tmp_path / "run", [0.1, 0.2], meshes={0: surface})
    assert deepest_crossing(run, run.levels[0]).depth == 0.0
    assert rest_gaps(run.levels[0], run.render_meshes[0]) == pytest.approx((0.0, 0.1), abs=1e-9)
    _, notes = export_run(run.path, "obj", tmp_path / "out")
    assert notes[1] == "level 0: render meshes cross nothing in 2 states"
