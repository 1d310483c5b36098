"""Data flows one way: scene -> levels -> potentials -> solve -> integrate -> store, brought together by runs. The tools
around this core are one wing, `pdvol/studio`, of which the core imports nothing.

What a scene lacks is not loaded. Each test lists all offenders at once.
"""

import ast
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pdvol
from commands import SAFETY

ROOT = Path(__file__).resolve().parents[2]
STAGES = ("geometry", "meshing", "levels", "potentials", "solve", "integrate", "store", "measure", "runs")
FOUNDATION = {"errors", "registry", "scene", "parallel", "processes", "compat", "compiled", "native", "stages"}
"""Modules beside the stages that any stage may use: they know none of them (a test)."""
STORED = {"geometry", "store"}
"""What everything that reads stored runs may use."""
MAY_IMPORT: dict[str, set[str]] = {
    "forms": set(),
    "meshes": set(),
    "geometry": set(),
    "meshing": {"meshes", "geometry"},
    "levels": {"forms", "meshes", "geometry", "meshing"},
    "potentials": {"forms", "geometry", "levels"},
    "solve": {"forms", "geometry", "levels", "potentials"},
    "integrate": {"geometry", "levels", "potentials", "solve"},
    "store": {"geometry", "levels"},
    "measure": STORED,
    "runs": {"forms", "meshes", *STAGES[:-1]},
    "studio": STORED,
    "studio.imports": {"meshes", "geometry", "meshing"},
    "studio.draw": STORED | {"levels", "studio"},
    "studio.export": STORED | {"runs", "studio"},
    "studio.play": STORED | {"measure", "studio", "studio.draw"},
    "studio.wedge": STORED | {"levels", "measure", "runs", "studio", "studio.draw"},
    "studio.study": STORED | {"levels", "measure", "runs", "studio", "studio.draw", "studio.wedge"},
    "studio.live": STORED | {"runs", "studio", "studio.draw", "studio.play", "studio.wedge"},
}
WING = {name for name in MAY_IMPORT if name.startswith("studio")}
"""The tools; "studio" is what lies beside its folders."""
MAY_IMPORT["commands"] = {*MAY_IMPORT}
ABOVE = {*WING, "commands"}
"""What stands on the core: no stage knows of it."""
MOST_ARGUMENTS = 8
SOURCES = [
    *sorted((ROOT / "pdvol").rglob("*.py")),
    *sorted((ROOT / "forms").rglob("*.py")),
    *sorted((ROOT / "meshes").rglob("*.py")),
]


def place(path: Path) -> str:
    """A file's path from the root of the repository."""
    return path.relative_to(ROOT).as_posix()


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def module_of(path: Path) -> str:
    """`pdvol.meshing.build` of a file; forms/ and meshes/ are installed below pdvol."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts if parts[0] == "pdvol" else ("pdvol", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def imports(path: Path) -> frozenset[str]:
    """Modules a file imports, wherever in it, relative ones made absolute."""
    module = module_of(path)
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *([node.module] if node.module else [])])
            found |= {f"{base}.{alias.name}" for alias in node.names}
    return frozenset(found)


def stage(module: str) -> str:
    """`meshing` of `pdvol.meshing.build`, `studio.draw` of `pdvol.studio.draw.film`, `errors` of
    `pdvol.errors.InputError`, empty for `pdvol` itself and for other packages.
    """
    parts = module.split(".")
    if parts[0] != "pdvol" or len(parts) < 2:
        return ""
    folder = ".".join(parts[1:3])
    return folder if folder in WING else parts[1]


def stages_of(name: str) -> set[str]:
    """What a module of pdvol, or all files of a package, import from pdvol."""
    own = ROOT / "pdvol" / name
    files = sorted(own.rglob("*.py")) if own.is_dir() else [own.with_suffix(".py")]
    return {stage(i) for path in files for i in imports(path) if i.split(".")[0] == "pdvol"}


def test_each_stage_imports_only_stages_before_it():
    assert [
        f"{place(path)} imports {imported}"
        for path in SOURCES
        if (own := stage(module_of(path))) in MAY_IMPORT
        for also in [FOUNDATION if own in (*STAGES, *ABOVE) else set()]
        for imported in sorted(imports(path))
        if imported.split(".")[0] == "pdvol" and stage(imported) not in MAY_IMPORT[own] | {own} | also
    ] == []


def test_every_folder_is_a_known_stage():
    folders = {p.name for p in (ROOT / "pdvol").iterdir() if (p / "__init__.py").exists()}
    assert folders - FOUNDATION - ABOVE == set(STAGES), "a new folder needs a line in MAY_IMPORT"
    tools = {f"studio.{p.name}" for p in (ROOT / "pdvol" / "studio").iterdir() if (p / "__init__.py").exists()}
    assert tools | {"studio"} == WING, "a new folder of the studio needs a line in MAY_IMPORT"


def test_the_foundation_knows_no_stage():
    known = {name: stages_of(name) & {*STAGES, *ABOVE, "cli"} for name in FOUNDATION}
    assert {name: found for name, found in known.items() if found} == {}
    assert stages_of("scene") <= {"scene", "errors", "registry", "forms", "meshes"}
    assert stages_of("registry") <= {"errors"}


def test_forms_and_meshes_are_pure():
    # forms: UFL alone. meshes: geometry alone.
    heavy = {"dolfinx", "petsc4py", "mpi4py", "ipctk", "basix", "ffcx"}
    tops = {path: {i.split(".")[0] for i in imports(path)} for path in SOURCES}
    assert {
        place(path): found
        for path, used in tops.items()
        if (stage(module_of(path)) in ("forms", "meshes") and (found := used & heavy))
        or (stage(module_of(path)) == "forms" and (found := used - {"ufl", "pdvol", "math", "collections"}))
    } == {}


def test_no_two_files_import_each_other():
    files = {module_of(path): path for path in SOURCES if path.name != "__init__.py"}
    needs = {
        name: {
            module for module in (i if i in files else i.rpartition(".")[0] for i in imports(path)) if module in files
        }
        for name, path in files.items()
    }
    for name in needs:
        reached, ahead = set(), set(needs[name])
        while ahead:
            reached |= ahead
            ahead = set().union(*(needs[other] for other in ahead)) - reached
        assert name not in reached, f"{name} imports itself, by way of others"


def test_functions_have_few_arguments():
    """Those that travel together are one object. What `pdvol` itself offers has its options as words."""
    offered, many = set(pdvol.__all__), []
    for path in SOURCES:
        for function in (node for node in ast.walk(parsed(path)) if isinstance(node, ast.FunctionDef)):
            names = [each.arg for each in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)]
            count = len([name for name in names if name not in ("self", "cls")])
            if count > MOST_ARGUMENTS and function.name not in offered:
                many.append(f"{place(path)}: {function.name} has {count}")
    assert not many, many


def test_one_file_of_snes_and_one_of_dolfinx_and_petsc():
    """A wheel of dolfinx needs its MPI loaded first: elsewhere these come from compat, whatever is imported first."""
    texts = {place(path): path.read_text() for path in SOURCES}
    assert [name for name, text in texts.items() if re.search(r"\bSNES\(\)", text)] == ["pdvol/solve/newton.py"]
    assert {name for name, text in texts.items() if "dolfinx.__version__" in text} <= {"pdvol/compat.py"}
    importing = {place(p) for p in SOURCES if {i.split(".")[0] for i in imports(p)} & {"dolfinx", "petsc4py"}}
    assert importing == {"pdvol/compat.py"}


def test_without_dolfinx_a_command_says_in_one_line_what_to_install(tmp_path):
    (tmp_path / "scene.py").write_text(SCENE + "run = lambda: scene\n")
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['dolfinx'] = None  # as if not installed\n")
    done = ended(["-m", "pdvol", "run", "scene.py:run"], tmp_path, PYTHONPATH=str(tmp_path))
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "no dolfinx" in done.stderr and "pip install '.[solver]'" in done.stderr


def test_ranks_of_another_mpi_are_refused(tmp_path):
    """Each would be alone, and all would write into one run folder."""
    (tmp_path / "scene.py").write_text(SCENE + "def pair(): return scene\n")
    done = ended(["-m", "pdvol", "check", "scene.py"], tmp_path, OMPI_COMM_WORLD_SIZE="2")
    said = done.stderr.splitlines()
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert said[-1].startswith("pdvol: 2 processes were started by the launcher of another MPI than ")
    assert len(said) == 1 or "suspicious MPI execution environment" in said[0], (
        "mpi4py's wheel has a warning of its own"
    )


def test_no_two_modules_have_a_constant_of_the_same_name():
    owners: dict[str, set[str]] = {}
    for path in SOURCES:
        for node in parsed(path).body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            names = [n.id for target in targets if target for n in ast.walk(target) if isinstance(n, ast.Name)]
            for name in names:
                if name.isupper() and not name.startswith("_"):
                    owners.setdefault(name, set()).add(place(path))
    assert {name: sorted(files) for name, files in owners.items() if len(files) > 1} == {}


# ---- what is loaded when


def ended(words, cwd, **variables) -> subprocess.CompletedProcess:
    env = {**os.environ, **variables}
    return subprocess.run([sys.executable, *words], cwd=cwd, env=env, capture_output=True, text=True, timeout=SAFETY)


def loaded_after(program: str, cwd) -> set[str]:
    """Top-level packages in sys.modules at the end of a program of its own."""
    program += "\nimport sys\nprint('LOADED', *sorted({name.split('.')[0] for name in sys.modules}))\n"
    done = ended(["-c", program], cwd)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("LOADED")]
    return set(line.split()[1:])


SCENE = """
import numpy as np
import pdvol
from pdvol import Barrier, Body, Flow, Friction, Gravity, Impulse, NeoHookean, Outline, Placement, Plane, Region, Rigid
from pdvol import Scene, Solid, Support, Surface
corners, triangles = np.array([(0.0, 0), (1, 0), (1, 1), (0, 1)]), np.array([(0, 1, 2), (0, 2, 3)], np.int32)
square = Solid(corners, triangles, np.zeros(2, np.int32))
tip = Region(NeoHookean(2e10, damping=0.01), lambda X: X[:, 1] > 0.5)
scene = Scene(bodies=(Body((square, square), NeoHookean(1e5), regions=(tip,)),), dt=0.01, steps=2,
              loads=(Gravity((0.0, -9.81)), Flow((1.0, 0.0)), Impulse((1.0, 0.0))),
              supports=(Support(lambda X: X[:, 1] < 0.1),))
"""
FINITE_ELEMENTS = {"dolfinx", "petsc4py", "basix", "ffcx"}


def test_describing_a_scene_and_reading_a_run_load_no_solver(tmp_path):
    heavy = FINITE_ELEMENTS | {"mpi4py", "ipctk", "gmsh", "pyvista", "vtkmodules", "meshio", "trimesh", "pytetwild"}
    assert loaded_after(SCENE + "pdvol.open_run\n", tmp_path) & heavy == set()


def test_storing_exporting_drawing_and_measuring_load_no_finite_elements(tmp_path):
    folders = ("store", "measure", "studio", "studio.draw", "studio.export", "studio.play")
    modules = [module_of(path) for path in SOURCES if stage(module_of(path)) in folders]
    assert len(modules) > 15
    program = "import importlib\nfor name in " + repr(modules) + ": importlib.import_module(name)"
    assert not loaded_after(program, tmp_path) & (FINITE_ELEMENTS | {"mpi4py"})


SOLVE = (
    SCENE
    + """
from pdvol.levels.hierarchy import Hierarchy
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.integrate.stepper import Stepper
from pdvol.levels.model import level_model
from pdvol.integrate.marches import Start, direct
from mpi4py import MPI
mesh = LevelMesh(square.vertices, square.cells.astype(np.int64), np.zeros(2, np.int32), np.zeros(2, np.int32))
hierarchy = Hierarchy([mesh], MPI.COMM_WORLD)
stepper = Stepper(level_model(scene, hierarchy, 0, 1.0), hierarchy[0])
reports = list(direct(stepper, Start.at_rest(mesh.points, 0 * mesh.points), 2))
pdvol
"""
)


def test_solving_without_contact_never_loads_the_contact_library(tmp_path):
    loaded = loaded_after(SOLVE, tmp_path)
    assert "dolfinx" in loaded and "ipctk" not in loaded
