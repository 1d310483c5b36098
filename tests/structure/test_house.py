"""Data flows one way: scene -> levels -> potentials -> solve -> integrate -> store, read by export, draw and measure. What a scene
lacks is not loaded.
"""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
STAGES = (
    "geometry",
    "meshing",
    "levels",
    "potentials",
    "solve",
    "integrate",
    "store",
    "export",
    "draw",
    "measure",
)
FOUNDATION = {"errors", "registry", "scene", "parallel", "processes", "compat"}
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
    "store": {"geometry"},
    "export": STORED,
    "draw": STORED,
    "measure": STORED,
    "runs": {"forms", "meshes", *STAGES},
    "commands": {"forms", "meshes", *STAGES, "runs"},
}
ABOVE = {"runs", "commands"}
"""What brings the stages together: no stage knows of it."""
SOURCES = [
    *sorted((ROOT / "pdvol").rglob("*.py")),
    *sorted((ROOT / "forms").rglob("*.py")),
    *sorted((ROOT / "meshes").rglob("*.py")),
]


def module_of(path: Path) -> str:
    """`pdvol.meshing.build` of a file; forms/ and meshes/ are installed below pdvol."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts if parts[0] == "pdvol" else ("pdvol", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path: Path) -> set[str]:
    """Modules a file imports, wherever in it, relative ones made absolute."""
    module = module_of(path)
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *([node.module] if node.module else [])])
            found |= {f"{base}.{alias.name}" for alias in node.names}
    return found


def stage(module: str) -> str:
    """`hierarchy` of `pdvol.meshing.build`, `errors` of `pdvol.errors.InputError`, empty for `pdvol` itself and for
    other packages.
    """
    parts = module.split(".")
    return parts[1] if parts[0] == "pdvol" and len(parts) > 1 else ""


@pytest.mark.parametrize(
    "path", [p for p in SOURCES if stage(module_of(p)) in MAY_IMPORT], ids=lambda p: str(p.relative_to(ROOT))
)
def test_each_stage_imports_only_stages_before_it(path):
    own = stage(module_of(path))
    allowed = MAY_IMPORT[own] | {own}
    if own in (*STAGES, *ABOVE):
        allowed |= FOUNDATION
    for imported in imports(path):
        if imported.split(".")[0] != "pdvol":
            continue
        assert stage(imported) in allowed, f"{path.relative_to(ROOT)} ({own}) imports {imported}"


def test_every_folder_is_a_known_stage():
    folders = {p.name for p in (ROOT / "pdvol").iterdir() if (p / "__init__.py").exists()}
    assert folders - FOUNDATION - ABOVE == set(STAGES), "a new folder needs a line in MAY_IMPORT"


def stages_of(name: str) -> set[str]:
    """What a module of pdvol, or all files of a package, import from pdvol."""
    own = ROOT / "pdvol" / name
    files = sorted(own.rglob("*.py")) if own.is_dir() else [own.with_suffix(".py")]
    return {stage(i) for path in files for i in imports(path) if i.split(".")[0] == "pdvol"}


@pytest.mark.parametrize("name", sorted(FOUNDATION))
def test_the_foundation_knows_no_stage(name):
    assert not stages_of(name) & set(STAGES)


def test_scene_knows_only_forms_and_meshes():
    assert stages_of("scene") <= {"scene", "errors", "registry", "forms", "meshes"}
    assert stages_of("registry") <= {"errors"}


def test_forms_and_meshes_are_pure():
    # forms: UFL alone. meshes: geometry alone.
    for path in SOURCES:
        if stage(module_of(path)) in ("forms", "meshes"):
            tops = {i.split(".")[0] for i in imports(path)}
            assert not tops & {"dolfinx", "petsc4py", "mpi4py", "ipctk", "basix", "ffcx"}, path
    for path in (ROOT / "forms").glob("*.py"):
        assert {i.split(".")[0] for i in imports(path)} <= {"ufl", "pdvol", "math", "collections"}, path


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


def test_one_file_of_snes_and_one_of_what_differs_between_dolfinx_versions():
    using = {p.relative_to(ROOT).as_posix() for p in SOURCES if re.search(r"\bSNES\(\)", p.read_text())}
    assert using == {"pdvol/solve/newton.py"}
    asking = {p.relative_to(ROOT).as_posix() for p in SOURCES if "dolfinx.__version__" in p.read_text()}
    assert asking <= {"pdvol/compat.py"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_module_says_what_it_is(path):
    tree = ast.parse(path.read_text())
    own = ast.get_docstring(tree)
    if tree.body and not (path.name == "__init__.py" and len(tree.body) <= 1):
        assert own, "no docstring"
    for node in tree.body:
        if (
            isinstance(node, ast.FunctionDef | ast.ClassDef)
            and not node.name.startswith("_")
            and not path.name.endswith("_worker.py")
        ):
            assert ast.get_docstring(node), f"{node.name} has no docstring"


def test_no_print_no_exit_and_no_asserts_outside_the_command_line():
    for path in SOURCES:
        if path.name == "cli.py" or path.parent.name == "commands" or path.name.endswith("_worker.py"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            where = f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}"
            assert not isinstance(node, ast.Assert), f"{where}: assert"
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                to_a_file = any(k.arg == "file" for k in node.keywords)
                assert called not in ("sys.exit", "exit", "quit") and not (called == "print" and not to_a_file), (
                    f"{where}: {called}"
                )


# ---- what is loaded when
# -----------------------------------------------------------------------------------------------------


def loaded_after(program: str, cwd) -> set[str]:
    """Top-level packages in sys.modules at the end of a program of its own."""
    program += "\nimport sys\nprint('LOADED', *sorted({name.split('.')[0] for name in sys.modules}))\n"
    ended = subprocess.run([sys.executable, "-c", program], cwd=cwd, capture_output=True, text=True, timeout=100)
    assert ended.returncode == 0, ended.stderr
    (line,) = [line for line in ended.stdout.splitlines() if line.startswith("LOADED")]
    return set(line.split()[1:])


SCENE = """
import numpy as np
import pdvol
from pdvol import Body, Flow, Gravity, Impulse, NeoHookean, Region, Placement, Scene, Solid, Support, Barrier, Plane, Friction, Rigid, Outline, Surface
square = Solid(np.array([(0.0, 0), (1, 0), (1, 1), (0, 1)]), np.array([(0, 1, 2), (0, 2, 3)], np.int32), np.zeros(2, np.int32))
tip = Region(NeoHookean(2e10, damping=0.01), lambda X: X[:, 1] > 0.5)
scene = Scene(bodies=(Body((square, square), NeoHookean(1e5), regions=(tip,)),), dt=0.01, steps=2,
              loads=(Gravity((0.0, -9.81)), Flow((1.0, 0.0)), Impulse((1.0, 0.0))),
              supports=(Support(lambda X: X[:, 1] < 0.1),))
"""
FINITE_ELEMENTS = {"dolfinx", "petsc4py", "basix", "ffcx"}


def test_describing_a_scene_loads_no_solver(tmp_path):
    heavy = FINITE_ELEMENTS | {"mpi4py", "ipctk", "gmsh", "pyvista", "vtkmodules", "meshio", "trimesh", "pytetwild"}
    for program in ("import pdvol", SCENE):
        assert loaded_after(program, tmp_path) & heavy == set()


def test_reading_a_run_loads_no_finite_elements(tmp_path):
    assert not loaded_after("import pdvol; pdvol.open_run", tmp_path) & (
        FINITE_ELEMENTS | {"mpi4py", "ipctk", "gmsh", "pyvista"}
    )


SOLVE = (
    SCENE
    + """
from pdvol.levels.hierarchy import Hierarchy
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.integrate.stepper import LevelProblem
from pdvol.integrate.marches import Start, direct
from mpi4py import MPI
mesh = LevelMesh(square.vertices, square.cells.astype(np.int64), np.zeros(2, np.int32), np.zeros(2, np.int32))
hierarchy = Hierarchy([mesh], MPI.COMM_WORLD)
problem = LevelProblem(scene, hierarchy[0], 0, 1.0, [])
reports = list(direct(problem, Start(0, mesh.points, 0 * mesh.points), 2))
pdvol
"""
)


def test_solving_without_contact_never_loads_the_contact_library(tmp_path):
    loaded = loaded_after(SOLVE, tmp_path)
    assert "dolfinx" in loaded and "ipctk" not in loaded


def readme_commands() -> list[str]:
    """Lines `./run ...` within README.md's fences."""
    readme = ROOT / "README.md"
    text = readme.read_text() if readme.exists() else ""
    blocks = re.findall(r"^```[^\n]*\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [line.strip().removeprefix("$ ").split(" #")[0].strip() for line in lines if "./run " in line]


@pytest.mark.parametrize("line", readme_commands() or ["./run pdvol --help"])
def test_readme_commands_name_what_exists(line):
    from pdvol.cli import parse

    words = line[line.index("./run ") + 6 :].split()
    if words[0] == "mpirun":
        words = words[3:]
    assert words[0] in ("pdvol", "pytest", "python", "bash"), line
    for word in words:
        if word.startswith(("demos/", "tests/")):
            assert (ROOT / word).exists(), line
    if words[0] != "pdvol" or "--help" in words:
        return
    try:
        parse([word for word in words[1:] if word not in ("...",)])
    except SystemExit:
        pytest.fail(f"README: pdvol refuses {line!r}")
