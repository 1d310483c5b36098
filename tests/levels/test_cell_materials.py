"""Regions: chosen on the coarsest level, carried to the finer ones by the binding; nothing is bound where bodies are
uniform.
"""

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.materials import cell_materials, level_materials
from pdvol.scene import Body, FixedCorotational, NeoHookean, Region, Scene, StVenantKirchhoff
from shapes import box, together

SOFT, STIFF = NeoHookean(2e4, density=500.0), NeoHookean(2e10, density=2000.0)
DIMENSIONS = [2, 3]


def scene(*bodies):
    return Scene(bodies, dt=0.01, steps=1)


def body(material=SOFT, name="body", **settings):
    return Body(("grid",), material, name=name, **settings)


def right(X):
    return X[:, 0] > 0.5


def centres(mesh):
    return mesh.points[mesh.cells].mean(axis=1)


def levels(d, *meshes):
    return Hierarchy(meshes, MPI.COMM_SELF)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_regions_follow_the_coarse_cells(d):
    """Fine cells have the material of the coarse cell that their centre lies in, not of their own place: the animation
    is the same.
    """
    coarse, middle, fine = box(d, 2, jitter=0.1, seed=1), box(d, 3, jitter=0.1, seed=2), box(d, 5, jitter=0.1, seed=3)
    hierarchy = levels(d, coarse, middle, fine)
    shot = scene(body(regions=(Region(STIFF, right),)))
    found = [level_materials(shot, hierarchy, k) for k in range(3)]
    for mesh, above, of, of_above in ((middle, coarse, found[1], found[0]), (fine, middle, found[2], found[1])):
        inside = 0
        for c, young in zip(centres(mesh), of.young, strict=True):
            gradients = above.hat_gradients
            weights = np.einsum("kij,kj->ki", gradients, c - above.points[above.cells[:, 0]])
            weights[:, 0] += 1.0
            homes = np.flatnonzero(weights.min(axis=1) > 1e-9)
            inside += len(homes)
            assert len(homes) == 0 or young == of_above.young[homes[0]]
        assert inside > 0.8 * len(mesh.cells)
    for of in found:
        assert set(of.young) == {2e4, 2e10} and set(of.density) == {500.0, 2000.0} and of.softest == 2e4
    np.testing.assert_array_equal(found[0].young == 2e10, right(centres(coarse)))


def test_cells_outside_the_coarse_mesh_have_the_material_of_the_nearest_region():
    """That it sticks out of, and never that of another body: two bodies touch, and the finer level reaches further."""
    low = lambda x, out: ([x - out * (x < 1.0), -out], [x + 1.0 + out * (x > 0.0), 1.0 + out])
    pair = lambda n, out=0.0: together(*(box(2, n, *low(x, out)) for x in (0.0, 1.0)))
    shot, mesh = scene(body(regions=(Region(STIFF, right),)), body(FixedCorotational(7.0), name="other")), pair(6, 0.3)
    of, (x, y), first = level_materials(shot, levels(2, pair(2), mesh), 1), centres(mesh).T, mesh.bodies == 0
    assert of.laws == (NeoHookean, FixedCorotational)
    assert np.all((of.young == 7.0) == ~first) and np.all((of.law == 1) == ~first)
    out = first & ((x < 0) | (y < 0) | (y > 1)) & (np.abs(x - 0.5) > 0.35)
    assert out.sum() > 10
    np.testing.assert_array_equal(of.young[out] == 2e10, x[out] > 0.5)


def test_labels_functions_and_overlaps():
    """A label of the input's cells, a function of position as modulus, and the last of two regions where both apply."""
    mesh = box(2, 4)
    mesh = LevelMesh(mesh.points, mesh.cells, mesh.bodies, (centres(mesh)[:, 1] > 0.5).astype(np.int32) * 3)
    graded = SOFT.__class__(young=lambda X: 1e4 * (1 + X[:, 0]), density=500.0)
    of = cell_materials(scene(body(graded, regions=(Region(StVenantKirchhoff(5.0), right), Region(STIFF, 3)))), mesh)
    x, y = centres(mesh).T
    np.testing.assert_allclose(of.young, np.where(y > 0.5, 2e10, np.where(x > 0.5, 5.0, 1e4 * (1 + x))), rtol=1e-15)
    assert of.laws == (NeoHookean, StVenantKirchhoff)
    np.testing.assert_array_equal(of.law == 1, (y < 0.5) & (x > 0.5))
    mu = of.young / 2.8  # poisson 0.4
    for number, values in enumerate(of.values):
        np.testing.assert_allclose(values["mu"], np.where(of.law == number, mu, 0.0), rtol=1e-15)
    assert of.softest == 5.0
