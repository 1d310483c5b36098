"""Graphs and colours against values that are known by hand."""

import json

import numpy as np
import pytest

import runs
from pdvol.store.reader import open_run
from pdvol.studio.play.curves import Curves
from pdvol.studio.play.document import player_page, with_strain
from pdvol.studio.play.fields import packed_fields, per_area
from pdvol.studio.play.packing import Chunks
from pdvol.studio.play.panes import panes_of_run

DENSITY = 1200.0
MATERIAL = {"bodies": [{"material": {"density": DENSITY}}, {"material": {"density": DENSITY}}]}


def stored(path, dim, motions, log=()):
    """A run of two bodies whose levels move as `motions` say: functions (points, step) -> positions."""
    meshes = runs.level_meshes(dim, [80 + 60 * i for i in range(len(motions))])
    info = {"scene": "made up", "dt": 0.1, "steps": 3, "method": "direct", "description": MATERIAL}
    with runs.RunWriter.create(path, info, meshes, ["left", "right"]) as writer:
        for level, (mesh, moved) in enumerate(zip(meshes, motions, strict=True)):
            for step in range(4):
                record = {"level": level, "step": step, "energy": dict(log)} if step and log else None
                writer.write_state(level, step, moved(mesh.points, step), record)
    return open_run(path)


@pytest.mark.parametrize("dim", [2, 3])
def test_energies_of_a_steady_flight(dim, tmp_path):
    velocity = np.arange(1.0, dim + 1)
    run = stored(tmp_path / "run", dim, [lambda X, step: X + 0.1 * step * velocity], {"elastic": 2.0, "load": -7.0})
    curves = Curves(run).of_level(0, range(4))
    kinetic = 0.5 * DENSITY * run.levels[0].mesh.volumes.sum() * velocity @ velocity
    assert np.allclose(curves["kinetic"][1:], kinetic, rtol=1e-9)
    assert np.isnan(curves["total"][0]) and np.allclose(curves["total"][1:], kinetic - 5.0, rtol=1e-9)
    assert curves["load"][1:] == [-7.0] * 3
    assert "centre" not in curves and Curves(run).note == ""
    bare = {k: v for k, v in run.info.items() if k != "description"}
    (run.path / "run.json").write_text(json.dumps(bare))
    assert "masses are volumes" in player_page(panes_of_run(open_run(run.path)))


def test_drift_is_the_largest_of_a_body(tmp_path):
    def turned(X, step):
        moved = X.copy()
        right = X[:, 0] > 0
        centre = X[right].mean(axis=0)
        c, s = np.cos(0.2 * step), np.sin(0.2 * step)
        moved[right] = (X[right] - centre) @ np.array([[c, s], [-s, c]]) + centre
        moved[~right] += [0.03 * step, 0.04 * step]
        return moved

    run = stored(tmp_path / "run", 2, [lambda X, step: X, turned])
    curves = Curves(run).of_level(1, range(4))
    assert np.allclose(curves["centre"], 0.05 * np.arange(4), atol=1e-3)
    assert np.allclose(curves["turn"], np.degrees(0.2 * np.arange(4)), atol=1e-6)
    runs.keep_states(run.levels[0].folder, 3)
    centres = Curves(open_run(run.path)).of_level(1, range(4))["centre"]
    assert [np.isnan(value) for value in centres] == [False] * 3 + [True], "it ends where the level below does"


def test_forces_are_spread_over_the_boundary(tmp_path):
    level = stored(tmp_path / "run", 3, [lambda X, step: X]).levels[0]
    corners = level.rest[level.surface]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 6
    pushed = np.zeros_like(level.rest)
    for corner in level.surface.T:
        np.add.at(pushed, corner, -250.0 * np.linalg.norm(normals, axis=1)[:, None] * [0.0, 0.0, 1.0])
    pressure = per_area(level, lambda step: pushed)(0)
    on_boundary = np.unique(level.surface)
    assert np.allclose(pressure[on_boundary], 250.0, rtol=1e-9) and pressure.sum() == pytest.approx(
        250 * len(on_boundary)
    )
    assert per_area(level, lambda step: np.full_like(pushed, np.nan))(0).max() == 0.0


def test_fields_share_one_scale(tmp_path):
    run = stored(tmp_path / "run", 3, [lambda X, step: X * (1.0 + 0.1 * step), lambda X, step: X])
    panes = [with_strain(pane) for pane in panes_of_run(run)]
    chunks = Chunks()
    fields, numbers = packed_fields([(pane.stored, pane.steps, pane.fields) for pane in panes], chunks)
    assert list(fields) == ["strain"] and [list(found) for found in numbers] == [["strain"]] * 2
    assert fields["strain"]["top"] == pytest.approx(0.3, rel=1e-6)
    for number, level in zip(numbers, run.levels, strict=True):
        assert chunks.entries[number["strain"]]["shape"] == [level.steps, len(np.unique(level.surface)), 1]
    assert json.dumps(fields)
