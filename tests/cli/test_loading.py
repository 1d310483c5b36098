"""Each verb loads what it needs and no more."""

import subprocess
import sys

import pytest

from cli_scenes import CUBE_OFF, FALL, write

PLOTTING = {"pyvista", "vtkmodules", "matplotlib"}
SOLVING = {"dolfinx", "petsc4py", "mpi4py", "ipctk"}
READING = {"meshio", "trimesh"}


def loaded_by(words, cwd):
    """Exit code, output, and the top-level packages that one command line has loaded."""
    program = """
import sys
from pdvol.cli import run
try:
    code = run(sys.argv[1:])
except SystemExit as end:
    code = end.code
print("LOADED", *sorted({name.partition(".")[0] for name in sys.modules}))
sys.exit(code)
"""
    command = [sys.executable, "-c", program, *map(str, words)]
    ended = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=100)
    lines = ended.stdout.splitlines()
    assert lines and lines[-1].startswith("LOADED"), ended.stderr
    return ended.returncode, "\n".join(lines[:-1]), set(lines[-1].split()[1:])


@pytest.mark.parametrize(
    "words", [["--help"], ["run", "--help"], ["export", "--help"], ["metrics", "--help"], ["info"], ["magic"]]
)
def test_help_and_mistakes_load_no_numpy(words, tmp_path):
    code, _, loaded = loaded_by(words, tmp_path)
    assert code == (0 if "--help" in words else 2)
    assert "pdvol" in loaded and not loaded & ({"numpy", "scipy", "ufl"} | PLOTTING | SOLVING | READING)


def test_info_of_a_scene_loads_what_the_scene_needs(tmp_path):
    write(tmp_path / "fall.py", FALL)
    code, out, loaded = loaded_by(["info", "fall.py"], tmp_path)
    assert code == 0 and "body 'square': NeoHookean" in out
    assert "ufl" in loaded and not loaded & (PLOTTING | SOLVING | READING | {"igl", "skimage"})


def test_info_of_a_scene_with_a_file_loads_no_reader(tmp_path):
    write(tmp_path / "cube.off", CUBE_OFF)
    text = "import pdvol\ndef scene():\n    body = pdvol.Body('cube.off', pdvol.NeoHookean(1e5), (8,))\n"
    write(tmp_path / "cube.py", text + "    return pdvol.Scene((body,), dt=0.01, steps=1)\n")
    code, out, loaded = loaded_by(["info", "cube.py"], tmp_path)
    assert code == 0 and "diagonal of the smallest free body" in out
    assert not loaded & (PLOTTING | SOLVING | READING), "files are read in a child process"


def test_exports_without_fields_load_no_finite_elements(whole, tmp_path):
    code, _, loaded = loaded_by(["export", whole, "--format", "obj", "-o", tmp_path / "obj"], tmp_path)
    assert code == 0 and not loaded & (PLOTTING | SOLVING | READING | {"h5py"})


def test_metrics_load_no_renderer(whole, tmp_path):
    code, _, loaded = loaded_by(["metrics", whole], tmp_path)
    assert code == 0 and "matplotlib" in loaded and not loaded & {"pyvista", "vtkmodules", "trimesh"}


def test_python_m_pdvol_is_the_command(tmp_path):
    ended = subprocess.run(
        [sys.executable, "-m", "pdvol", "info", "gone.py"], cwd=tmp_path, capture_output=True, text=True, timeout=100
    )
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr == "pdvol: there is no scene file gone.py\n"


def test_all_public_names_load_no_renderer():
    program = 'import sys; from pdvol import *; assert "pyvista.plotting" not in sys.modules'
    subprocess.run([sys.executable, "-c", program], check=True, timeout=100)
