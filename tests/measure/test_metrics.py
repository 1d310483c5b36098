"""Each measure on numbers made by hand; how a run is measured is tested with the command line."""

import numpy as np
import pytest
import scipy.sparse as sp

import runs
from pdvol.geometry.level_mesh import LevelMesh, lumped_masses
from pdvol.geometry.rigid_motions import mass_centres
from pdvol.measure import metrics
from pdvol.studio.draw.plots import plot_metrics

RNG = np.random.default_rng(0)


def test_masses_are_the_cells_shared_out():
    """Two triangles of area 1/2 and 1 with densities 6 and 3: a third of 3 kg to each corner of both."""
    points, cells = np.array([[0.0, 0], [1, 0], [0, 1], [2, 1]]), np.array([[0, 1, 2], [1, 3, 2]])
    mesh = LevelMesh(points, cells, np.array([0, 1], np.int32), np.zeros(2, np.int32))
    assert mesh.volumes == pytest.approx([0.5, 1.0])
    np.testing.assert_allclose(lumped_masses(mesh, [6.0, 3.0]), [1.0, 2.0, 2.0, 1.0])


def test_continuity_by_hand():
    """One vertex of 2 kg on a line: own prediction 2, x+ = 4, pull 2, x_hat = 5: e = 2 (1 + 1)^2 = 8, e_hat = 2 (4 - 5
    + 2)^2 = 2. What goes by its own prediction has a quarter, whatever the residual.
    """
    at = lambda x: np.array([[float(x)]])
    assert metrics.continuity(at(2), at(5), at(4), at(2), np.array([2.0])) == pytest.approx(4.0)
    assert np.isnan(metrics.continuity(at(2), at(5), at(3), at(2), np.array([2.0])))
    own, after, pull = RNG.normal(size=(3, 7, 3))
    assert metrics.continuity(own, own, after, pull, RNG.uniform(size=7)) == pytest.approx(0.25, rel=1e-14)


def test_distance_is_a_mean_over_the_mass():
    x = RNG.normal(size=(3, 2))
    assert metrics.distance(x + [0.3, 0.4], x, np.array([1.0, 5.0, 2.0])) == pytest.approx(0.5)
    shift = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    assert metrics.distance(x + shift, x, np.array([1.0, 1.0, 2.0])) == pytest.approx(0.5)


def test_roughness_is_what_changes_from_step_to_step():
    """Nothing for a motion of third order; 16 times the amplitude of one that goes back and forth."""
    x, masses, t = RNG.normal(size=(3, 2)), np.array([1.0, 5.0, 2.0]), np.arange(5.0)
    smooth = [x * (1.0 + n - 2.0 * n**2 + 0.5 * n**3) for n in t]
    assert metrics.roughness(smooth, masses) == pytest.approx(0.0, abs=1e-12)
    shaken = [x + 1e-3 * (-1.0) ** n * np.array([0.6, 0.8]) for n in t]
    assert metrics.roughness(shaken, masses) == pytest.approx(16e-3)
    half = [x + 1e-3 * (-1.0) ** n * np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]]) for n in t]
    assert metrics.roughness(half, np.array([2.0, 3.0, 3.0])) == pytest.approx(8e-3)


def test_jitter_of_free_fall_and_of_none():
    g, dt, masses = 9.81, 0.02, np.array([1.0, 2.0])
    x, v = RNG.normal(size=(2, 2)), np.array([3.0, -1.0])
    fall = [x + v * n * dt - np.array([0.0, g]) * dt**2 * n**2 / 2 for n in range(3)]
    assert metrics.jitter(*fall, dt, masses) == pytest.approx(0.5 * 3.0 * g**2 * dt**2)
    assert metrics.jitter(*(x + v * n for n in range(3)), dt, masses) == pytest.approx(0.0, abs=1e-20)


def test_centres_of_mass():
    bodies, masses = np.array([0, 0, 1]), np.array([1.0, 3.0, 2.0])
    x = np.array([[0.0, 0.0], [4.0, 0.0], [1.0, 7.0]])
    centres = mass_centres(x, masses, bodies)
    np.testing.assert_allclose(centres, [[3.0, 0.0], [1.0, 7.0]])
    # One body of 4 kg is 5 m off, one of 12 kg where it should be.
    assert metrics.centre_error(centres + [[3.0, 4.0], [0.0, 0.0]], centres, np.array([4.0, 12.0])) == pytest.approx(
        2.5
    )


def prolongation(n, m, per_row=3):
    weights = sp.lil_matrix((n, m))
    for i in range(n):
        w = RNG.normal(size=per_row)
        weights[i, RNG.choice(m, per_row, replace=False)] = w / w.sum()
    return weights.tocsr()


def test_projection_is_the_pseudoinverse():
    P = prolongation(40, 8)
    projection = metrics.Projection(P)
    assert projection.rank == projection.columns == 8 == np.linalg.matrix_rank(P.toarray())
    fine, coarse = RNG.normal(size=(40, 3)), RNG.normal(size=(8, 3))
    np.testing.assert_allclose(
        projection.difference(fine, coarse), np.linalg.pinv(P.toarray()) @ fine - coarse, atol=1e-7
    )
    assert np.abs(projection.difference(P @ coarse, coarse)).max() == 0.0


def test_projection_where_coarse_vertices_are_not_seen():
    """A coarse vertex without a fine one, and two that only ever occur by halves: rank 8 of 10, and the smallest
    difference.
    """
    P = sp.hstack([prolongation(40, 8), sp.csr_matrix((40, 2))]).tolil()
    P[:, 9] = 0.5 * P[:, [3]]
    P[:, 3] = 0.5 * P[:, [3]]
    P = P.tocsr()
    projection = metrics.Projection(P)
    assert (projection.rank, projection.columns) == (8, 10)
    fine, coarse = RNG.normal(size=(40, 2)), RNG.normal(size=(10, 2))
    difference = projection.difference(fine, coarse)
    assert (difference[8] == 0).all()
    np.testing.assert_allclose(difference, np.linalg.pinv(P.toarray()) @ (fine - P @ coarse), atol=1e-5)
    assert np.abs(projection.difference(P @ coarse, coarse)).max() == 0.0


@pytest.mark.parametrize("diagonal", [0.0, 1.0])
def test_negative_eigenvalues_are_counted(diagonal):
    for _ in range(5):
        A = sp.random(30, 30, 0.15, random_state=RNG)
        A = (A + A.T + diagonal * sp.diags(RNG.normal(size=30))).tolil()
        if not diagonal:
            A.setdiag(0.0)
            A += 1e-3 * sp.eye(30)
        expected = int(np.sum(np.linalg.eigvalsh(A.toarray()) < 0))
        assert metrics.negative_eigenvalues(sp.csc_matrix(A)) == expected


def test_metrics_are_drawn(tmp_path):
    from PIL import Image

    level = {"level": 0, "steps": 3, "continuity": [0.25, float("nan"), 0.3], "jitter": [0.0, 0.0, 0.0]}
    finer = {"level": 1, "steps": 3, "continuity": [0.25, 4.0, 1e7], "consistency": [0.0, 1e-3, 2e-3, 1e-3]}
    sizes = []
    for levels in ([level], [level, finer]):
        run = {"run": "a", "dt": runs.DT, "levels": levels}
        sizes.append(Image.open(plot_metrics(tmp_path / "metrics.png", [run, {**run, "run": "b"}])).size)
    assert sizes[1][1] > 1.5 * sizes[0][1], "a panel for each measure that there is"
