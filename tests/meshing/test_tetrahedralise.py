"""Tetrahedra: their number, orientation, quality, and that the same input gives the same mesh."""

from pathlib import Path

import numpy as np
import pytest

from hostile_files import shifted, together
from pdvol import meshes
from pdvol.errors import MeshError
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.distances import hausdorff_distance
from pdvol.geometry.level_mesh import boundary_facets, simplex_volumes
from pdvol.meshes import Surface
from pdvol.meshing import cpu_budget
from pdvol.meshing import tetrahedralise as tetrahedra
from pdvol.meshing.decimate import topology
from pdvol.meshing.edge_length import ACCEPTED_DEVIATION
from pdvol.meshing.readers import read_shape
from pdvol.meshing.tetrahedralise import mean_ratio, tetrahedralise
from pdvol.meshing.validate import check_surface, drop_unused

SURFACES = Path(__file__).parents[2].parent / "shared" / "meshes" / "surfaces"


SOLIDS = [(meshes.ball(1.0, 2), 150), (meshes.bar(1.0, 0.2, 0.2, 0.1), 200)]


@pytest.mark.parametrize(("surface", "target"), SOLIDS, ids=["ball", "bar"])
def test_a_mesh_of_the_wanted_size(surface, target):
    mesh = tetrahedralise(surface, target)
    assert abs(len(mesh.points) / target - 1.0) <= ACCEPTED_DEVIATION
    assert len(np.unique(mesh.cells)) == len(mesh.points), "no unused points"
    assert simplex_volumes(mesh.points, mesh.cells).min() > 0.0
    assert mean_ratio(mesh.points, mesh.cells).min() > 0.1
    facets, _ = boundary_facets(mesh.cells)
    points, facets = drop_unused(mesh.points, facets)
    check_surface(Surface(points, facets))


@pytest.mark.skipif(not SURFACES.exists(), reason="the shared meshes are not here")
@pytest.mark.parametrize("name", ["goathead.obj", "torus.off"])
def test_300_vertices_of_shared_surfaces(name):
    surface = read_shape(SURFACES / name)
    mesh = tetrahedralise(surface, 300)
    assert abs(len(mesh.points) / 300 - 1.0) <= 0.2
    assert mean_ratio(mesh.points, mesh.cells).min() > 0.05
    volume = enclosed_volume(surface.vertices, surface.triangles)
    assert simplex_volumes(mesh.points, mesh.cells).sum() == pytest.approx(volume, rel=1e-9)
    points, facets = drop_unused(mesh.points, boundary_facets(mesh.cells)[0])
    assert topology(facets, len(points)) == topology(surface.triangles, len(surface.vertices))
    diagonal = np.linalg.norm(np.ptp(surface.vertices, axis=0))
    # measured: 0 to 1.4 % of the diagonal; a surface of triangles of 6 % of it can miss a feature's tip
    assert hausdorff_distance(points, facets, surface.vertices, surface.triangles) < 0.025 * diagonal


def test_two_parts_stay_two():
    cube = meshes.box()
    mesh = tetrahedralise(Surface(*together(shifted(cube, 0.0), shifted(cube, (1.05, 0, 0)))), 150)
    sides = mesh.points[mesh.cells][:, :, 0] < 0.525
    assert (sides.all(axis=1) | ~sides.any(axis=1)).all(), "no cell bridges the gap"
    with pytest.raises(MeshError, match="encloses no volume"):
        tetrahedralise(Surface(cube.vertices, cube.triangles[:, ::-1]), 50)


def faulty(name):
    """What a mesher might return for a cube, made from a good mesh of it."""
    made = meshes.brick((1.0, 1.0, 1.0), (4, 4, 4))
    points, cells = made.vertices.copy(), made.cells
    if name == "no cells":
        cells = cells[:0]
    if name == "flat":
        points[np.abs(points).max(axis=1) < 0.1] += (0.2499, 0.0, 0.0)
    if name == "crossing":
        cells = np.vstack([cells, cells + len(points)])
        points = np.vstack([points, points + 0.6])
    if name == "hollow":
        cells = cells[np.abs(points[cells].mean(axis=1)).max(axis=1) > 0.25]
    return points, cells


@pytest.mark.parametrize(
    ("name", "said"), [("no cells", "no cells"), ("flat", "quality"), ("crossing", "cross"), ("hollow", "2 shells")]
)
def test_what_a_mesher_returns_is_checked(name, said, monkeypatch):
    """No attempt is good, and the last one's defect is named."""
    monkeypatch.setattr(tetrahedra, "ftetwild", lambda *_, **__: faulty(name))
    with pytest.raises(MeshError, match=f"no valid mesh .* came out .*{said}"):
        tetrahedralise(meshes.box(), 125)


def test_few_vertices_take_few_points_around_the_shape(monkeypatch):
    lengths, made = [], tetrahedra.ftetwild

    def kept(vertices, triangles, edge_length, *limits):
        lengths.append(edge_length / np.linalg.norm(np.ptp(vertices, axis=0)))
        return made(vertices, triangles, edge_length, *limits)

    monkeypatch.setattr(tetrahedra, "ftetwild", kept)
    before = cpu_budget._used()
    assert 10 <= len(tetrahedralise(meshes.box(), 20).points) <= 40
    assert max(lengths) <= tetrahedra.LONGEST_EDGE * (1 + 1e-12)
    assert cpu_budget._used() - before < 15.0, "once 13 s each"
