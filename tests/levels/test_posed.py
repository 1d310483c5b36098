"""Starts that are given on a mesh, or by a stored state of another run."""

from dataclasses import replace

import numpy as np
import pytest

import pdvol
from pdvol import Body, Gravity, NeoHookean, Posed, Scene, Solid, Support
from pdvol.levels.start import posed_positions
from pdvol.runs.fingerprint import describe
from pdvol.runs.scene_summary import modelled_terms
from shapes import box, solid, together

SOFT = NeoHookean(2e4, 0.3, 1000.0)
RNG = np.random.default_rng(3)


def linear(X):
    d = X.shape[1]
    return X @ (np.eye(d) + 0.3 * np.arange(d * d).reshape(d, d) / d**2) + 1.0


@pytest.mark.parametrize("d", [2, 3])
def test_a_linear_map_is_exact_inside_and_beyond(d):
    mesh = box(d, 3, jitter=0.2)
    posed = Posed(mesh.points, mesh.cells, linear(mesh.points))
    points = RNG.uniform(-0.04, 1.04, (200, d))
    np.testing.assert_allclose(posed_positions(posed, points, "it"), linear(points), rtol=1e-12)
    np.testing.assert_array_equal(posed_positions(posed, mesh.points, "it"), linear(mesh.points))


def test_inside_a_cell_it_is_that_cell_s_map():
    """A square of two triangles, one corner pulled: halfway along the diagonal nothing moves."""
    points, cells = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), [[0, 1, 2], [0, 2, 3]]
    posed = Posed(points, cells, points + [[0, 0], [0.5, 0.0], [0, 0], [0, 0]])
    asked = np.array([[0.5, 0.5], [0.75, 0.25], [0.25, 0.75]])
    np.testing.assert_allclose(posed_positions(posed, asked, "it") - asked, [[0, 0], [0.25, 0.0], [0, 0]], atol=1e-15)


def test_a_run_begins_with_a_state_of_another_one(tmp_path):
    """A beam that hangs in its weight, from its settled state on level 0: that level is there to the last bit and stays
    there, and the finer one starts and stays near.
    """
    solids = tuple(Solid(m.points * (1.0, 0.2), m.cells.astype(np.int32), m.regions) for m in (box(2, 6), box(2, 12)))
    beam = Body(solids, replace(SOFT, young=1e6, damping=0.3), name="beam")
    held = (Support(lambda X: X[:, 0] < 1e-9),)
    shot = Scene((beam,), 0.02, 150, loads=(Gravity((0.0, -9.81)),), supports=held)
    before = pdvol.run(shot, tmp_path / "settled", levels=0).levels[0]
    settled = before.positions(150)
    assert (settled - before.rest)[:, 1].min() < -0.02
    posed = Posed(before.rest, before.cells, settled)
    run = pdvol.run(replace(shot, bodies=(replace(beam, start=posed),), steps=20), tmp_path / "after")
    np.testing.assert_array_equal(run.levels[0].positions(0), settled)
    np.testing.assert_allclose(run.levels[0].positions(20), settled, atol=2e-4)
    fine = run.levels[1]
    same = [np.flatnonzero(np.isclose(fine.rest, X).all(axis=1))[0] for X in before.rest]
    np.testing.assert_allclose(fine.positions(0)[same], settled, atol=1e-12)
    assert run.info["description"]["bodies"][0]["start"]["type"] == "Posed"


def test_a_part_of_the_cells_is_one_body_of_several():
    """The other body, which lies nearer to the asked point, does not count."""
    mesh = together(box(2, 2), box(2, 2, 1.05, 2.05))
    posed = Posed(
        mesh.points, mesh.cells[mesh.bodies == 0], mesh.points + np.where(mesh.point_bodies == 0, 5.0, 9.0)[:, None]
    )
    np.testing.assert_allclose(posed_positions(posed, np.array([[1.04, 1.04]]), "it"), [[6.04, 6.04]])
    alone, points = mesh.body(0)
    np.testing.assert_array_equal(posed_positions(posed, alone.points, "it"), mesh.points[points] + 5.0)


def test_other_positions_are_another_scene():
    mesh = box(2, 2)
    shots = [
        Scene((Body((solid(2, 2),), SOFT, start=Posed(mesh.points, mesh.cells, s * mesh.points)),), 0.01, 1)
        for s in (1, 2)
    ]
    assert describe(shots[0]) == describe(shots[0]) != describe(shots[1])
    assert "body 'body': starts away from rest, where a posed mesh leads it" in modelled_terms(shots[0])
