"""Where bodies start: the same function on all levels, and checks of t = 0 where bodies are then, not at rest."""

from dataclasses import replace

import numpy as np
import pytest

import pdvol
from pdvol import Barrier, Body, IntersectionError, NeoHookean, Plane, Scene, Separate
from pdvol.levels.initial_state import smallest_gap
from pdvol.levels.level_check import level_defects, level_notes
from pdvol.levels.obstacles import placed_obstacles
from pdvol.levels.start import started
from pdvol.meshing.build import build_levels
from pdvol.runs.scene_summary import modelled_terms
from pdvol.runs.separation import build_apart
from shapes import solid

SOFT = NeoHookean(1e5, 0.3, 1000.0)


def cube(start=None, d=2, low=0.0, name="cube", levels=(2, 4)):
    return Body(tuple(solid(d, n, low, low + 1.0) for n in levels), SOFT, name=name, start=start)


def scene(*bodies, **settings):
    given = {"contact": (Barrier(dhat=1e-3),)} | settings
    return Scene(bodies, 0.01, 2, **given)


def curved(X):
    """Not linear, and no cell of a unit cube turns."""
    return X + 0.3 * np.roll(X, 1, axis=1) ** 2 + 2.0


def defects(the_scene, level=0):
    found = level_defects(the_scene, build_levels(the_scene), level, placed_obstacles(the_scene.obstacles), 1.0)
    return [str(defect.error) for defect in found]


@pytest.mark.parametrize("d", [2, 3])
def test_every_level_starts_by_the_same_function(d, tmp_path):
    """Of its own rest positions, which stay the mesh; a body without a start stays at rest."""
    run = pdvol.run(scene(cube(curved, d), cube(None, d, -2.0, "other")), tmp_path / "run")
    for level in run.levels:
        mine = level.mesh.point_bodies == 0
        np.testing.assert_array_equal(level.positions(0)[mine], curved(level.rest[mine]))
        np.testing.assert_array_equal(level.positions(0)[~mine], level.rest[~mine])
        np.testing.assert_allclose(level.rest[mine].min(axis=0), 0.0)
        assert level.log[0]["energy"]["elastic"] > 0.0
    # What levels carry over is motion: the finer one is no further from the coarser one than it was at the start.
    coarse, fine = run.levels
    same = [np.flatnonzero((fine.rest == X).all(axis=1))[0] for X in coarse.rest]
    apart = [np.abs(fine.positions(k)[same] - coarse.positions(k)).max() for k in range(3)]
    assert apart[0] == 0.0 and 0.0 < apart[2] < 0.02


@pytest.mark.parametrize("method", ["direct", "tracks", "embedded"])
def test_other_methods_start_there_too(method, tmp_path):
    """An embedded level begins where the level below does, prolonged: its first step is no jump."""
    shot = scene(cube(curved), penalty=pdvol.Penalty(weight=0.1), contact=())
    run = pdvol.run(shot, tmp_path / "run", method=method)
    coarse, fine = run.levels
    off = np.abs(fine.positions(0) - curved(fine.rest)).max()
    if method != "embedded":
        assert off == 0.0
        return
    # Every other vertex lies in the middle of coarse edges, where the parabola is 0.3 (1/4)^2 off.
    assert off == pytest.approx(0.3 / 16)
    moves = [np.abs(level.positions(1) - level.positions(0)).max() for level in run.levels]
    assert moves[1] == pytest.approx(moves[0], rel=1e-9)


def test_what_meets_is_asked_where_bodies_start():
    """Two cubes in one place at rest start apart; two that are apart start in one place; so with a plane."""
    away, into = lambda X: X + (3.0, 0.0), lambda X: X - 1.5
    floor = Plane((0.0, 0.5), (0.0, 1.0))
    assert defects(scene(cube(), cube(away, name="other"))) == []
    (said,) = defects(scene(cube(), cube(into, low=2.0, name="other")), 1)
    assert (
        said.startswith("level 1: body 'cube' crosses body 'other' at t = 0, by up to 0.5 m, from (")
        and "\n" not in said
    )
    assert defects(scene(cube(lambda X: X + (0.0, 1.0)), obstacles=(floor,))) == []
    (said,) = defects(scene(cube(lambda X: X - (0.0, 0.7), low=0.6), obstacles=(floor,)))
    assert "level 0: 6 vertices are at or below" in said and "by 0.6 m" in said


def test_the_level_that_is_turned_is_named():
    """Sharper than coarse cells can see: only the finer level has vertices in the fold."""
    fold = lambda X: np.column_stack([np.where(np.abs(X[:, 0] - 0.25) < 0.01, 0.6, X[:, 0]), X[:, 1]])
    shot = scene(cube(fold), contact=())
    assert defects(shot, 0) == []
    (said,) = defects(shot, 1)
    assert said.startswith("level 1: the start of body 'cube' turns 8 of 32 cells inside out")


def test_notes_and_gaps_are_those_of_the_start():
    shot = scene(cube(lambda X: X * (1.5, 0.8)))
    note = "level 0: body 'cube' starts away from rest, its cells stretched by 0.8 to 1.5"
    assert note in level_notes(shot, build_levels(shot)[0], 0, 1.0)
    assert "body 'cube': starts away from rest, where curved leads it" in modelled_terms(scene(cube(curved)))
    shot = scene(cube(), cube(lambda X: X - (0.9, 1.9), low=2.0, name="other"))
    gap, _ = smallest_gap(started(shot, build_levels(shot)[0], 0), (), ["cube", "other"], 0.4)
    assert gap["distance"] == pytest.approx(0.1)


def test_separate_moves_only_bodies_without_a_start():
    """A start is a function of place: the other body moves."""
    shot = scene(cube(), cube(lambda X: X - (1.02, 1.9), low=2.0, name="other"), separate=(Separate("move"),))
    with pytest.raises(IntersectionError):
        raise next(level_defects(shot, build_levels(shot), 0, (), 1.0)).error
    meshes, lines = build_apart(shot, 2, ())
    assert len(lines) == 1 and lines[0].startswith("body 'cube' moved by (-")
    assert [list(level_defects(shot, meshes, level, (), 1.0)) for level in (0, 1)] == [[], []]
    stay = lambda X: 1.0 * X
    both = replace(shot, bodies=(cube(stay), shot.bodies[1]))
    with pytest.raises(IntersectionError, match="after move"):
        build_apart(both, 2, ())
