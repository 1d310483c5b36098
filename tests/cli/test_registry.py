"""Names that a user chooses from: every one leads to what implements it, and another package can add its own."""

import importlib
import sys

import numpy as np
import pytest
from mpi4py import MPI

from cli_scenes import pdvol
from pdvol import Body, NeoHookean, Scene, meshes, registry
from pdvol.errors import InputError
from pdvol.levels.hierarchy import Hierarchy
from pdvol.meshing.build import build_levels
from pdvol.registry import INTERPOLANTS

REGISTRIES = [value for value in vars(registry).values() if isinstance(value, registry.Registry)]


@pytest.mark.parametrize("names", REGISTRIES, ids=lambda names: names.noun)
def test_every_name_leads_somewhere_and_an_unknown_one_is_refused_with_the_legal_ones(names):
    assert len(names) == len(list(names)) > 0
    for name in names:
        assert name in names and names[name] is not None
        assert isinstance(names.help(name), str)
    assert "magic" not in names
    for ask in (names.check, names.help, names.__getitem__):
        with pytest.raises(InputError, match=f"unknown {names.noun} 'magic'; choose one of {', '.join(names)}"):
            ask("magic")


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Makes a package as pip installs it: its file and a dist-info folder, in a folder of sys.path."""

    def forget():
        importlib.invalidate_caches()
        for names in REGISTRIES:
            vars(names).pop("_installed", None)

    def install_(name, source, entry_points):
        (tmp_path / f"{name}.py").write_text(source)
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(entry_points)
        forget()

    monkeypatch.syspath_prepend(str(tmp_path))
    yield install_
    monkeypatch.undo()
    forget()


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


def test_an_interpolant_of_another_package(install):
    names = "nearest = nearest_pd:nearest\nbarycentric = nearest_pd:barycentric\ntorn = nearest_pd:no\n"
    install("nearest_pd", NEAREST, f"[pdvol.interpolants]\n{names}")
    assert "phong" in INTERPOLANTS and "_installed" not in vars(INTERPOLANTS), "a name of pdvol's own asks no package"
    assert list(INTERPOLANTS) == ["barycentric", "biharmonic", "phong", "nearest", "torn"]
    assert "nearest_pd" not in sys.modules, "listing loads nothing"
    assert INTERPOLANTS.help("nearest") == "from the package nearest_pd"
    assert INTERPOLANTS["barycentric"].__module__ == "pdvol.levels.interpolants.barycentric"
    with pytest.raises(
        InputError, match="the prolongation 'torn' of the package nearest_pd cannot be loaded: Attribute"
    ):
        INTERPOLANTS["torn"]
    scene = Scene((Body(meshes.disc(0.5), NeoHookean(1e5), (20, 60)),), dt=0.01, steps=1)
    weights = Hierarchy(build_levels(scene), MPI.COMM_SELF, "nearest").prolongation(1).weights()
    assert np.unique(weights.data).tolist() == [1.0] and weights.shape[1] < weights.shape[0] == weights.nnz


COUNTING = """
def export(run, levels, out, fields):
    out.mkdir(parents=True)
    (out / "states.txt").write_text(" ".join(str(run.levels[level].steps) for level in levels))
    return [out / "states.txt"]
"""
STEPS = """
def add_arguments(parser):
    parser.add_argument("run")
def main(options):
    import pdvol
    print(pdvol.open_run(options.run).info["steps"])
    return 1
"""


def test_a_format_and_a_command_of_another_package(install, whole, tmp_path, capsys):
    install("counting", COUNTING, "[pdvol.formats]\ncount = counting:export\n")
    install("stepping", STEPS, "[pdvol.commands]\nsteps = stepping\ninfo = stepping\n")
    assert pdvol("export", whole, "--format", "count", "-o", tmp_path / "out") == 0
    assert capsys.readouterr() == (f"{tmp_path / 'out' / 'states.txt'}\n", "")
    assert (tmp_path / "out" / "states.txt").read_text() == "11 11"
    assert pdvol("export", "--help") == 0
    assert "{xdmf,obj,usd,pc2,alembic,count}" in capsys.readouterr().out
    assert pdvol("steps", whole) == 1
    assert capsys.readouterr() == ("10\n", "")
    assert pdvol("info", whole) == 0
    assert "method progressive" in capsys.readouterr().out, "pdvol's own comes first"
    assert pdvol("--help") == 0
    assert "from the package stepping" in capsys.readouterr().out
    assert pdvol("stops") == 2
    said = capsys.readouterr().err.replace("'", "")  # versions of Python quote the choices or not
    assert ", steps); see pdvol --help\n" in said and said.count("\n") == 1
