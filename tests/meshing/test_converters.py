"""Converters that messages name work on a sample of their kind."""

import shutil
import subprocess
from pathlib import Path

import gmsh
import meshio
import pytest
import trimesh

from hostile_files import CUBE, POINTS, TETS, off, ply, stl
from pdvol.errors import MeshError
from pdvol.meshing.file_kinds import CONVERTERS, converter
from pdvol.meshing.readers import read_shape
from pdvol.meshing.validate import check_surface


def sample(folder, suffix) -> Path:
    """A small file of a kind that is not read, by a program that writes this kind."""
    path = folder / f"a{suffix}"
    if suffix in (".glb", ".gltf", ".dae", ".3mf"):
        trimesh.Trimesh(CUBE.vertices, CUBE.triangles).export(path)
    elif suffix == ".geo":
        path.write_text('SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 1, 1, 1};\n')
    elif suffix in (".step", ".stp", ".iges", ".igs", ".brep", ".bdf", ".nas", ".med", ".unv", ".cgns"):
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path.with_suffix(".bdf" if suffix == ".nas" else suffix)))
        gmsh.finalize()
        if suffix == ".nas":
            path.with_suffix(".bdf").rename(path)
    else:
        meshio.Mesh(POINTS, [("tetra", TETS)]).write(path)
    return path


def follow(path):
    """The shape that is read after the advice has been followed."""
    (command,) = converter(path).split("; convert it: ")[1:]
    subprocess.run(command, shell=True, cwd=path.parent, check=True, capture_output=True, timeout=100)
    (made,) = (one for one in path.parent.iterdir() if one.suffix in (".obj", ".msh", ".vtu"))
    assert len(read_shape(made).vertices) >= 5


def kinds() -> list:
    """All kinds but those of assimp; those that share a command with another one are left out of CI."""
    found, known = [], set()
    for suffix in (suffix for kinds in CONVERTERS for suffix in kinds):
        text = converter(Path(f"a{suffix}"))
        command = text.split("convert it: ")[-1].replace(f"a{suffix}", "a")
        if "assimp" not in text:
            found.append(pytest.param(suffix, marks=pytest.mark.slow if command in known else ()))
        known.add(command)
    return found


@pytest.mark.parametrize("suffix", kinds())
def test_the_printed_converter_converts(tmp_path, suffix, capfd):
    follow(sample(tmp_path, suffix))


@pytest.mark.parametrize("suffix", [".bdf", ".nas"])
def test_the_converter_of_a_deck_with_begin_bulk(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    meshio.Mesh(POINTS, [("tetra", TETS)]).write(path, file_format="nastran")
    assert "meshio" in converter(path)
    follow(path)


@pytest.mark.skipif(shutil.which("assimp") is None, reason="assimp is not here")
def test_assimp_converts(tmp_path):
    follow(sample(tmp_path, ".dae"))


def test_a_file_under_another_name_is_read_after_it_is_renamed(tmp_path):
    for name, data in {"a.obj": stl(CUBE), "b.stl": ply(), "c.ply": off(CUBE.vertices, CUBE.triangles)}.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(MeshError, match="rename it to ") as caught:
            read_shape(tmp_path / name)
        check_surface(read_shape((tmp_path / name).rename(tmp_path / str(caught.value).split("rename it to ")[1])))
