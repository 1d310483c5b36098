"""Names that a user chooses from: every one leads to what implements it, and another package can add its own."""

import os
import subprocess
import sys

import pytest

from pdvol import registry
from pdvol.errors import InputError

REGISTRIES = [value for value in vars(registry).values() if isinstance(value, registry.Registry)]


@pytest.mark.parametrize("names", REGISTRIES, ids=lambda names: names.noun)
def test_every_name_leads_somewhere(names):
    assert len(names) == len(list(names)) > 0
    for name in names:
        assert name in names and names[name] is not None
        assert isinstance(names.help(name), str)


@pytest.mark.parametrize("names", REGISTRIES, ids=lambda names: names.noun)
def test_an_unknown_name_is_refused_with_the_legal_ones(names):
    assert "magic" not in names
    for ask in (names.check, names.help, names.__getitem__):
        with pytest.raises(InputError, match=f"unknown {names.noun} 'magic'; choose one of {', '.join(names)}"):
            ask("magic")


def install(folder, name, source, entry_points):
    """A package as pip installs it: its files and a dist-info folder, in a folder of sys.path."""
    (folder / f"{name}.py").write_text(source)
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(entry_points)


def pdvol(folder, *words):
    """Exit code, output and errors of a command line in a process that finds packages in `folder`."""
    command = [sys.executable, "-m", "pdvol", *map(str, words)]
    env = os.environ | {"PYTHONPATH": str(folder)}
    ended = subprocess.run(command, env=env, capture_output=True, text=True, timeout=100)
    return ended.returncode, ended.stdout, ended.stderr


def python(folder, program, **more):
    """What a program prints in a process that finds packages in `folder`."""
    env = os.environ | {"PYTHONPATH": str(folder)}
    ended = subprocess.run(
        [sys.executable, "-c", program], env=env, capture_output=True, text=True, timeout=100, **more
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


NEAREST = """
import numpy as np
import scipy.sparse as sp
def nearest(coarse, fine, binding):
    near = coarse.mesh.cells[binding.cells, binding.weights.argmax(axis=1)]
    n = len(fine.mesh.points)
    return sp.csr_matrix((np.ones(n), (np.arange(n), near)), (n, len(coarse.mesh.points)))
def barycentric(coarse, fine, binding):
    raise AssertionError("pdvol's own comes first")
"""


def test_an_interpolant_of_another_package(tmp_path):
    names = "nearest = nearest_pd:nearest\nbarycentric = nearest_pd:barycentric\ntorn = nearest_pd:no\n"
    install(tmp_path, "nearest_pd", NEAREST, f"[pdvol.interpolants]\n{names}")
    program = """
import sys
from pdvol.registry import INTERPOLANTS
assert "phong" in INTERPOLANTS and "importlib.metadata" not in sys.modules, "a name of pdvol's own asks no package"
print(*INTERPOLANTS)
assert "nearest_pd" not in sys.modules, "listing loads nothing"
print(INTERPOLANTS.help("nearest"))
print(INTERPOLANTS["nearest"].__module__, INTERPOLANTS["barycentric"].__module__)
try:
    INTERPOLANTS["torn"]
except Exception as error:
    print(type(error).__name__, error)
"""
    names, help_, modules, error = python(tmp_path, program).splitlines()
    assert names == "barycentric biharmonic phong nearest torn"
    assert help_ == "from the package nearest_pd"
    assert modules == "nearest_pd pdvol.levels.interpolants.barycentric"
    assert error.startswith("InputError the prolongation 'torn' of the package nearest_pd cannot be loaded: Attribute")


def test_a_hierarchy_takes_it(tmp_path):
    install(tmp_path, "nearest_pd", NEAREST, "[pdvol.interpolants]\nnearest = nearest_pd:nearest\n")
    program = """
import numpy as np
from mpi4py import MPI
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.hierarchy import Hierarchy
from pdvol.meshing.build import build_levels
import pdvol
from pdvol import meshes
scene = pdvol.Scene((pdvol.Body(meshes.disc(0.5), pdvol.NeoHookean(1e5), (20, 60)),), dt=0.01, steps=1)
weights = Hierarchy(build_levels(scene), MPI.COMM_SELF, "nearest").prolongation(1).weights()
print(set(weights.data), weights.shape[1] < weights.shape[0] == weights.nnz)
"""
    assert python(tmp_path, program).split() == ["{np.float64(1.0)}", "True"]


COUNTING = """
def export(run, levels, out, fields):
    out.mkdir(parents=True)
    (out / "states.txt").write_text(" ".join(str(run.levels[level].steps) for level in levels))
    return [out / "states.txt"]
"""


def test_a_format_of_another_package(whole, tmp_path):
    install(tmp_path, "counting", COUNTING, "[pdvol.formats]\ncount = counting:export\n")
    words = ["export", whole, "--format", "count", "-o", tmp_path / "out"]
    assert pdvol(tmp_path, *words) == (0, f"{tmp_path / 'out' / 'states.txt'}\n", "")
    assert (tmp_path / "out" / "states.txt").read_text() == "11 11"
    assert "{xdmf,obj,usd,pc2,alembic,count}" in pdvol(tmp_path, "export", "--help")[1]


STEPS = """
def add_arguments(parser):
    parser.add_argument("run")
def main(options):
    import pdvol
    print(pdvol.open_run(options.run).info["steps"])
    return 1
"""


def test_a_command_of_another_package(whole, tmp_path):
    install(tmp_path, "stepping", STEPS, "[pdvol.commands]\nsteps = stepping\ninfo = stepping\n")
    assert pdvol(tmp_path, "steps", whole) == (1, "10\n", "")
    code, out, _ = pdvol(tmp_path, "info", whole)
    assert code == 0 and "method progressive" in out, "pdvol's own comes first"
    assert "from the package stepping" in pdvol(tmp_path, "--help")[1]
    code, _, err = pdvol(tmp_path, "stops")
    said = err.replace("'", "")  # versions of Python quote the choices or not
    assert code == 2 and ", steps); see pdvol --help\n" in said and err.count("\n") == 1
