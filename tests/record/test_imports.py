"""`record` works on arrays: it must not bring in a solver, MPI or PETSc."""

import subprocess
import sys
from pathlib import Path

import pdvol.record


def test_record_imports_no_solver():
    modules = sorted(p.stem for p in Path(pdvol.record.__file__).parent.glob("*.py") if p.stem != "__init__")
    assert "store" in modules and "pictures" in modules
    code = f"""
import importlib, sys
for name in {modules!r}:
    importlib.import_module("pdvol.record." + name)
heavy = ("dolfinx", "petsc4py", "mpi4py", "pdvol.solve", "pdvol.animate", "pdvol.potentials")
print([name for name in sys.modules if name.startswith(heavy)])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
