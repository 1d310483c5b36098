"""Each verb loads what it needs and no more."""

import subprocess
import sys

from cli_scenes import CUBE, CUBE_OFF, FALL, write

PLOTTING = {"pyvista", "vtkmodules", "matplotlib"}
SOLVING = {"dolfinx", "petsc4py", "mpi4py", "ipctk"}
READING = {"meshio", "trimesh"}
MESHING = {"gmsh", "pytetwild", "fast_simplification", "scipy.optimize"}
PROGRAM = """
import sys
from pdvol.cli import run
for line in sys.stdin:
    try:
        code = run(line.split())
    except SystemExit as end:
        code = end.code
    packages = {name.partition(".")[0] for name in sys.modules} | {"scipy.optimize"} & {*sys.modules}
    print("LOADED", code, *sorted(packages), flush=True)
from pdvol import *
assert "pyvista.plotting" not in sys.modules
"""
"""Command lines in one process, with the packages that it has loaded after each: those that need least come first."""


def test_each_verb_loads_what_it_needs(whole, tmp_path):
    write(tmp_path / "fall.py", FALL)
    write(tmp_path / "cube.off", CUBE_OFF)
    write(tmp_path / "cube.py", CUBE)
    alone = {"numpy", "scipy", "ufl"} | PLOTTING | SOLVING | READING
    lines = {
        "--help": (0, {"pdvol"}, alone),
        "run --help": (0, set(), alone),
        "export --help": (0, set(), alone),
        "metrics --help": (0, set(), alone),
        "info": (2, set(), alone),
        "magic": (2, set(), alone),
        "info fall.py": (0, {"ufl"}, PLOTTING | SOLVING | READING | {"igl", "skimage"}),
        f"export {whole} --format obj -o obj": (0, set(), PLOTTING | SOLVING | READING | {"h5py"}),
        "preview fall.py --steps 1 -o preview": (0, {"dolfinx"}, PLOTTING | READING | MESHING),
        f"metrics {whole}": (0, {"matplotlib"}, {"pyvista", "vtkmodules", "trimesh"}),
        "info cube.py --set vertices=(8,)": (0, set(), {"pyvista", "vtkmodules"}),
    }
    command, text = [sys.executable, "-c", PROGRAM], "\n".join(lines)
    ended = subprocess.run(command, cwd=tmp_path, input=text, capture_output=True, text=True, timeout=600)
    assert ended.returncode == 0, ended.stderr
    assert "body 'square': NeoHookean" in ended.stdout and "diagonal of the smallest free body" in ended.stdout
    found = [line.split()[1:] for line in ended.stdout.splitlines() if line.startswith("LOADED")]
    for (line, (code, needed, spared)), (its, *loaded) in zip(lines.items(), found, strict=True):
        assert int(its) == code, line
        assert needed <= set(loaded) and not spared & set(loaded), line
