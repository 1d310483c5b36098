"""Volume meshes as other programs write them: all that carries the data is read."""

import re
import shutil
from collections import Counter

import dolfinx
import gmsh
import h5py
import numpy as np
import pytest
import pyvista
from mpi4py import MPI

from cli_scenes import pdvol
from hostile_files import POINTS, SHELL, TETS
from pdvol.errors import InputError, MeshError
from pdvol.meshes import Solid, Surface
from pdvol.meshing.readers import read_shape, read_with_notes
from pdvol.meshing.validate import check_solid, check_surface


def labels(solid) -> dict[int, int]:
    return dict(sorted(Counter(solid.regions.tolist()).items()))


# ---- Gmsh


@pytest.fixture
def boxes():
    """A function that makes a mesh of three boxes in a row, of 1, 1 and 1 m, with physical groups of volumes."""

    def make(groups: dict[int, list[int]], dim: int = 3):
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        first, *others = [occ.addBox(x, 0, 0, 1, 1, 1) for x in range(3)]
        occ.fragment([(3, first)], [(3, other) for other in others])
        occ.synchronize()
        for group, entities in groups.items():
            gmsh.model.addPhysicalGroup(dim, entities, group)
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        gmsh.model.mesh.generate(3)
        counts = [len(gmsh.model.mesh.getElements(3, k)[1][0]) for k in (1, 2, 3)]

        def write(path, version=4.1, **options):
            for name, value in {"MshFileVersion": version, "SaveAll": 0, "Binary": 0, **options}.items():
                gmsh.option.setNumber(f"Mesh.{name}", value)
            gmsh.write(str(path))
            return path

        return write, counts

    yield make
    if gmsh.isInitialized():
        gmsh.finalize()


@pytest.mark.parametrize(
    ("version", "options", "dim"),
    [
        *((version, {"SaveAll": 1, "Binary": binary}, 3) for version in (2.2, 4.1) for binary in (0, 1)),
        *((version, {"SaveAll": 1}, 2) for version in (2.2, 4.1)),
        (1, {}, 3),
        (4.0, {}, 3),
        (4.1, {"SaveAll": 1, "SaveParametric": 1}, 3),
    ],
)
def test_gmsh_with_all_entities(tmp_path, boxes, version, options, dim):
    write, (one, two, three) = boxes({7: [1], 8: [2, 3]}, dim)
    solid = read_shape(write(tmp_path / "a.msh", version, **options))
    check_solid(solid)
    lost = version == 2.2 or dim == 2  # files of version 2.2 then hold no groups, but the entities
    assert labels(solid) == ({1: one, 2: two, 3: three} if lost else {7: one, 8: two + three})


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_gmsh_with_groups_of_faces_alone(tmp_path, boxes, version, capfd):
    write, _ = boxes({5: [1]}, 2)
    assert pdvol("check", write(tmp_path / "a.msh", version)) == 2
    said = capfd.readouterr().out
    assert "the surface is open" in said and "Gmsh saves only what is in physical groups: give the volume one" in said


def test_gmsh_of_higher_order(tmp_path, boxes):
    write, (one, two, three) = boxes({7: [1], 8: [2, 3]})
    for order in (2, 3):
        gmsh.model.mesh.setOrder(order)
        solid, notes = read_with_notes(write(tmp_path / "a.msh"))
        check_solid(solid)
        assert labels(solid) == {7: one, 8: two + three}
        assert notes == [f"{one + two + three:,} quadratic cells are read by their corners"]


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize(
    ("groups", "kept"),
    [
        ({7: [1], 8: [2, 3], 100: [1, 2, 3]}, {7: [1], 8: [2, 3]}),
        ({100: [1, 2, 3], 7: [2]}, {7: [2], 100: [1, 3]}),
        ({7: [1], 8: [2, 3], 9: [2, 3]}, {7: [1], 8: [2, 3]}),
        ({1: [1, 2, 3], 2: [1, 2], 3: [1]}, {1: [3], 2: [2], 3: [1]}),
    ],
)
def test_gmsh_groups_that_overlap(tmp_path, boxes, version, groups, kept):
    write, counts = boxes(groups)
    solid, notes = read_with_notes(write(tmp_path / "a.msh", version))
    check_solid(solid)
    size = lambda entities: sum(counts[k - 1] for k in entities)
    assert labels(solid) == {group: size(entities) for group, entities in kept.items()}
    assert notes == [
        "cells in several physical groups have the label of the smallest: group"
        f" {group} keeps {size(kept.get(group, [])):,} of its {size(entities):,} cells"
        for group, entities in sorted(groups.items())
        if kept.get(group) != entities
    ]


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("ghosts", [0, 1])
@pytest.mark.parametrize("groups", [{7: [1], 8: [2, 3]}, {}])
def test_partitioned_gmsh(tmp_path, boxes, version, ghosts, groups, capfd):
    write, (one, two, three) = boxes(groups)
    gmsh.option.setNumber("Mesh.PartitionCreateGhostCells", ghosts)
    gmsh.model.mesh.partition(3)
    expected = {7: one, 8: two + three} if groups else {1: one, 2: two, 3: three}
    whole = read_shape(write(tmp_path / "whole.msh", version))
    check_solid(whole)
    assert labels(whole) == expected
    assert labels(read_shape(write(tmp_path / "binary.msh", version, Binary=1))) == expected
    write(tmp_path / "part.msh", version, PartitionSplitMeshFiles=1)
    solid, notes = read_with_notes(tmp_path / "part_2.msh")
    check_solid(solid)
    assert labels(solid) == expected and len(solid.vertices) == len(whole.vertices)
    assert notes == ["its 3 files are read, as one mesh"]
    if version == 4.1:  # the other format does not say how many parts there are
        (tmp_path / "part_3.msh").unlink()
        with pytest.raises(MeshError, match=r"part 2 of a mesh that Gmsh has partitioned, without part_3\.msh beside"):
            read_shape(tmp_path / "part_2.msh")
        (tmp_path / "part_2.msh").rename(tmp_path / "other.msh")
        with pytest.raises(MeshError, match="part 2 of a mesh that Gmsh has partitioned"):
            read_shape(tmp_path / "other.msh")


def test_gmsh_runs_nothing(tmp_path, boxes):
    write, _ = boxes({})
    script = f'SystemCall "touch {tmp_path / "owned"}";\n'
    path = write(tmp_path / "a.msh")
    (tmp_path / "a.msh.opt").write_text(script)
    read_shape(path)
    for start in ("", "$Foo\n", "\n$MeshFormat\n"):
        path.write_text(start + script)
        with pytest.raises(MeshError, match="unreadable or truncated"):
            read_shape(path)
    assert not (tmp_path / "owned").exists()


# ---- XDMF and VTK


@pytest.fixture(scope="module")
def dolfinx_files(tmp_path_factory):
    """Files of a cube of 48 cells and of a square of 18, written by dolfinx."""
    folder = tmp_path_factory.mktemp("dolfinx")
    cube = dolfinx.mesh.create_unit_cube(MPI.COMM_SELF, 2, 2, 2)
    square = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 3, 3)
    numbers = np.arange(48, dtype=np.int32)
    cube.topology.create_connectivity(2, 3)
    rim = np.sort(dolfinx.mesh.exterior_facet_indices(cube.topology))
    tags = {"cells": (3, numbers, np.where(numbers < 12, 4, 9)), "facets": (2, rim, np.full(len(rim), 3))}
    tags["few"] = (3, numbers[::3], np.full(16, 5))
    tagged = {name: dolfinx.mesh.meshtags(cube, *its[:2], its[2].astype(np.int32)) for name, its in tags.items()}
    encodings = dolfinx.io.XDMFFile.Encoding
    for name, encoding in (("facets cells", encodings.ASCII), ("few", encodings.ASCII), ("facets", encodings.HDF5)):
        with dolfinx.io.XDMFFile(cube.comm, folder / f"{name}.xdmf", "w", encoding) as file:
            file.write_mesh(cube)
            for one in name.split():
                tagged[one].name = one
                file.write_meshtags(tagged[one], cube.geometry)
    functions = {
        name: dolfinx.fem.Function(dolfinx.fem.functionspace(cube, ("Lagrange", order, (3,))))
        for name, order in (("linear", 1), ("quadratic", 2))
    }
    with dolfinx.io.XDMFFile(cube.comm, folder / "series.xdmf", "w") as file:
        file.write_mesh(cube)
        for time in (0.0, 0.1, 0.2):
            file.write_function(functions["linear"], time)
    with dolfinx.io.XDMFFile(cube.comm, folder / "square.xdmf", "w") as file:
        file.write_mesh(square)
    for name, one in {"cube": cube, "flat": square}.items():
        with dolfinx.io.VTKFile(one.comm, folder / f"{name}.pvd", "w") as file:
            file.write_mesh(one)
    for name, function in functions.items():
        with dolfinx.io.VTKFile(cube.comm, folder / f"{name}.pvd", "w") as file:
            for time in (0.0, 0.1):
                file.write_function(function, time)
    return folder


@pytest.mark.parametrize(
    ("name", "regions", "notes"),
    [
        ("facets.xdmf", {0: 48}, []),
        ("facets cells.xdmf", {4: 12, 9: 36}, []),
        ("few.xdmf", {0: 32, 5: 16}, []),
        ("series.xdmf", {0: 48}, ["the first of its 3 steps is read"]),
        ("square.xdmf", {0: 18}, []),
        ("cube.pvd", {0: 48}, []),
        ("cube000000.pvtu", {0: 48}, []),
        ("flat_p0_000000.vtu", {0: 18}, []),
        ("linear.pvd", {0: 48}, ["the first of its 2 steps is read"]),
        ("quadratic_p0_000000.vtu", {0: 48}, ["48 quadratic cells are read by their corners"]),
    ],
)
def test_files_of_dolfinx(dolfinx_files, name, regions, notes):
    solid, found = read_with_notes(dolfinx_files / name)
    assert isinstance(solid, Solid) and labels(solid) == regions and found == notes
    check_solid(solid)


def test_steps_of_a_series_of_vtk(tmp_path):
    entry = '<DataSet timestep="{}" part="0" file="{}.vtu"/>'
    for step in range(3):
        grid(10, TETS, POINTS + step).save(tmp_path / f"{step}.vtu")
    entries = "".join(entry.format(0.1 * step, step) for step in range(3))
    path = tmp_path / "series.pvd"
    path.write_text(f'<VTKFile type="Collection" version="0.1"><Collection>{entries}</Collection></VTKFile>')
    assert read_with_notes(path, step=2)[1] == [] and [read_shape(path, k).vertices.min() for k in (0, 1, -1)] == [
        0,
        1,
        2,
    ]
    with pytest.raises(MeshError, match="there is no step 3; it has 3"):
        read_shape(path, 3)
    with pytest.raises(InputError, match=r"step = 1, and only files of \.xdmf, \.pvd have steps"):
        read_shape(tmp_path / "0.vtu", 1)


@pytest.mark.parametrize("name", ["cube.pvd", "cube000000.pvtu"])
def test_collections_without_their_files(dolfinx_files, tmp_path, name):
    shutil.copy(dolfinx_files / name, tmp_path / name)
    with pytest.raises(MeshError, match=r"there is no cube\w+\.\w+ beside it, with its data; keep the files together"):
        read_shape(tmp_path / name)


STEP = (
    '<Grid Name="step {0}" GridType="Uniform"><Topology TopologyType="Tetrahedron" NumberOfElements="2">'
    '<DataItem Dimensions="2 4" NumberType="Int" Precision="8" Format="HDF">level.h5:/cells</DataItem></Topology>'
    '<Geometry GeometryType="XYZ"><DataItem Dimensions="5 3" NumberType="Float" Precision="8" Format="HDF">'
    'level.h5:/points</DataItem></Geometry><Time Value="{0}.0" /><Attribute Name="region" AttributeType="Scalar"'
    ' Center="Cell"><DataItem Dimensions="2" NumberType="Int" Precision="4" Format="HDF">level.h5:/region</DataItem>'
    "</Attribute></Grid>"
)
"""One step of a level, as pdvol's export writes it."""


def test_own_series(tmp_path):
    with h5py.File(tmp_path / "level.h5", "w") as file:
        file.update({"cells": TETS, "points": POINTS, "moved": POINTS + 1.0, "region": np.array([3, 4], np.int32)})
    steps = STEP.format(0) + STEP.format(1).replace("/points", "/moved")
    path = tmp_path / "level_0.xdmf"
    path.write_text(
        '<?xml version="1.0"?><Xdmf Version="3.0"><Domain><Grid Name="level 0" GridType="Collection"'
        f' CollectionType="Temporal">{steps}</Grid></Domain></Xdmf>'
    )
    solid, notes = read_with_notes(path)
    assert labels(solid) == {3: 1, 4: 1} and notes == ["the first of its 2 steps is read"]
    for step, by in ((0, 0.0), (1, 1.0), (-1, 1.0)):
        np.testing.assert_array_equal(read_shape(path, step).vertices, POINTS + by)
    for step in (2, -3):
        with pytest.raises(MeshError, match=f"there is no step {step}; it has 2, numbered from 0"):
            read_shape(path, step)
    (tmp_path / "level.h5").rename(tmp_path / "other.h5")
    with pytest.raises(MeshError, match=r"there is no level\.h5 beside it"):
        read_shape(path)


@pytest.mark.parametrize("steps", [0, 2])
def test_pieces_of_a_level(tmp_path, steps):
    """Grids side by side, also within each step of a series, are one mesh: pieces of a parallel run."""
    with h5py.File(tmp_path / "level.h5", "w") as file:
        for piece, (cell, region) in enumerate(zip(TETS, (3, 4), strict=True)):
            used = np.unique(cell)
            file.update({f"cells{piece}": np.searchsorted(used, [cell]), f"points{piece}": POINTS[used]})
            file.update({f"region{piece}": np.array([region], dtype=np.int32)})
    pieces = [re.sub(r"(cells|points|region)<", rf"\g<1>{k}<", STEP.format(0)) for k in range(2)]
    pieces = [one.replace("2 4", "1 4").replace("5 3", "4 3").replace('"2"', '"1"') for one in pieces]
    side_by_side = '<Grid GridType="Collection" CollectionType="Spatial">{}{}</Grid>'.format(*pieces)
    series = f'<Grid GridType="Collection" CollectionType="Temporal">{side_by_side * steps}</Grid>'
    path = tmp_path / "level.xdmf"
    path.write_text(f'<Xdmf Version="3.0"><Domain>{series if steps else side_by_side}</Domain></Xdmf>')
    solid, notes = read_with_notes(path)
    assert labels(solid) == {3: 1, 4: 1} and notes == ([f"the first of its {steps} steps is read"] if steps else [])
    assert len(np.unique(solid.cells)) == 5
    check_solid(solid)
    bare = re.sub("<Attribute.*?</Attribute>", "", pieces[0])
    path.write_text(f'<Xdmf Version="3.0"><Domain>{side_by_side.replace(pieces[0], bare)}</Domain></Xdmf>')
    assert labels(read_shape(path)) == {0: 1, 4: 1}


def grid(kind, cells, points=POINTS):
    return pyvista.UnstructuredGrid(
        np.hstack([[len(cell), *cell] for cell in cells]), np.full(len(cells), kind), points
    )


SPHERE = pyvista.Sphere(theta_resolution=10, phi_resolution=10)
STRIPS = SPHERE.strip()
OF_VTK = {
    "tets.vtu": (lambda: grid(71, TETS), 2),
    "tets.vtk": (lambda: grid(71, TETS), 2),
    "triangles.vtu": (lambda: grid(69, SHELL), 4),
    "quad.vtu": (lambda: grid(70, [[0, 1, 2, 3]], np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])), 2),
    "strips.vtk": (lambda: STRIPS, 160),
    "strips.vtp": (lambda: STRIPS, 160),
    "strips.vtu": (lambda: STRIPS.cast_to_unstructured_grid(), 160),
    "sphere.vtp": (lambda: SPHERE, 160),
    "block.vtm": (lambda: pyvista.MultiBlock([SPHERE]), 160),
}


@pytest.mark.parametrize("name", OF_VTK)
def test_files_of_vtk(tmp_path, name):
    make, count = OF_VTK[name]
    make().save(tmp_path / name)
    shape = read_shape(tmp_path / name)
    assert len(shape.triangles if isinstance(shape, Surface) else shape.cells) == count
    (check_surface if isinstance(shape, Surface) else check_solid)(shape)


def test_a_flat_mesh_at_one_y_says_how_to_turn_it(tmp_path):
    grid(5, SHELL[1:2]).save(tmp_path / "side.vtu")
    (note,) = read_with_notes(tmp_path / "side.vtu")[1]
    assert note == "all of it lies at one x or y; for a scene in 2D turn it, so that it lies at one z"


@pytest.mark.parametrize("suffix", [".vtk", ".vtu"])
def test_voxels_are_not_left_out(tmp_path, suffix):
    voxels = pyvista.ImageData(dimensions=(3, 3, 3)).cast_to_unstructured_grid()
    for one in (voxels, voxels.merge(grid(10, TETS), merge_points=False)):
        one.save(tmp_path / f"a{suffix}")
        with pytest.raises(MeshError, match="8 of its cells are solids but no tetrahedra; export tetrahedra alone"):
            read_shape(tmp_path / f"a{suffix}")
