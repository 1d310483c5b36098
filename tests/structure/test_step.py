"""How much one step is: the files whose functions run between the call of `Stepper.step` and its return, and the
constants on their way.

Both are measured on the steps of a scene with everything in it: smoothed elements, BDF2, a plane, friction, a support
that moves a body, and an obstacle whose motion contact holds back.
"""

import ast
import re
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from pdvol.integrate.integrator import advance, past_of
from pdvol.scene import Barrier, Friction, Gravity, Plane, Rigid, Solver, Support, Translation
from problems import SOFT, block, make_scene, make_stepper, tetrahedron
from shapes import together

PDVOL = Path(sys.modules["pdvol"].__file__).parent
FILES, C_FILES, CONSTANTS = 24, 18, 35
"""At most: Python files of a step, C files of the libraries that it calls, constants in all of them."""
LAYOUT = {
    *("SPARE", "BOX", "SIDE", "LANES", "FOURS", "MAX_H", "DEPTH"),  # sizes of arrays
    "MAX_PARAMETERS",  # the same, for users' densities
    "GROUPS",  # how many eigensystems are found at once
    *("TRANSPOSED", "ELSEWHERE", "FILTERS"),  # codes of places and modes
    *("NO_MEMORY", "CONVERGED", "TOO_MANY", "INDEFINITE_PRECONDITIONER", "NOT_A_NUMBER", "INDEFINITE_MATRIX"),
    "LIBRARY_ERROR",  # PETSc's, as those before
}
"""Numbers that are no constants of the method: how memory is laid out, and codes. No result depends on them."""


class Constant(NamedTuple):
    """A constant, and the comment on its line or above."""

    file: str
    name: str
    comment: str


def everything_in_it():
    """A soft cube on a floor, one above it that a support presses down, and a ram that pushes the lower one aside."""
    scene = make_scene(
        (SOFT, SOFT),
        solver=Solver(tolerance=1e-3),
        elements="smoothed",
        integrator="bdf2",
        loads=(Gravity((0.0, 0.0, -9.81)),),
        contact=(Barrier(dhat=2e-3), Friction(0.3)),
        supports=(Support(lambda X: X[:, 2] > 0.55, motion=Translation((0.0, 0.0, -0.2))),),
        obstacles=(
            Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
            Rigid(("ram",), name="ram", motion=Translation((8.0, 0.0, 0.0))),
        ),
    )
    lower, upper = (block((0.0, 0.0, z), (0.3, 0.3, z + 0.3), 2) for z in (0.0015, 0.303))
    ram = tetrahedron([(-0.5, -0.2, 0.05), (-0.5, 0.5, 0.05), (-0.5, 0.15, 0.3), (-0.003, 0.15, 0.1)])
    return make_stepper(scene, together(lower, upper), [ram])


def files_run(work: Callable) -> tuple[set[Path], object]:
    """The files of pdvol whose functions `work()` calls, and its result."""
    found = set()

    def note(frame, event, argument):
        code = frame.f_code
        if event == "call" and code.co_name != "<module>" and code.co_filename.startswith(f"{PDVOL}/"):
            found.add(Path(code.co_filename))

    sys.setprofile(note)
    try:
        result = work()
    finally:
        sys.setprofile(None)
    return found, result


@cache
def python_files() -> list[Path]:
    """Those of steps 9 and 10: motions are checked at t = 0 alone, and steps are of implicit Euler while the ram's blow
    lasts.
    """
    stepper, files, substeps = everything_in_it(), set(), 0
    model = stepper.model
    past = past_of(stepper.integrator, lambda step: model.start, model.velocity, 0, model.dt)
    for number in range(1, 11):
        found, report = files_run(lambda number=number, past=past: stepper.step(number, past))
        assert report.newton_iterations > 0 and report.contacts > 0 and report.cuts == 0
        past = advance(stepper.integrator, past, report.positions, model.dt, struck=report.struck > 0)
        files |= found if number > 8 else set()
        substeps += report.remedies["substeps"] if number > 8 else 0
    assert substeps > 0 and len(past) == 2, "contact holds the ram back, and BDF2 has its two states"
    return sorted(files)


def c_files() -> list[Path]:
    """Of the libraries in folders `native` beside the files of a step, with the headers that they share. What only
    several ranks call is left out.
    """
    native = {path.parent / "native" for path in python_files()}
    folders = {folder for folder in native if folder.is_dir()}
    shared = {header for folder in folders for header in folder.parents[1].glob("*.h")}
    ranks = {folder / "border.c" for folder in folders}
    return sorted((shared | {path for folder in folders for path in folder.glob("*.[ch]")}) - ranks)


# ---- constants


def comment_of(lines: list[str], number: int, name: str, pattern: str) -> str:
    """The comment on a line (from 1), or the one that ends above it."""
    own = re.search(pattern, lines[number - 1].partition(name)[2])
    if own:
        return own[1].strip()
    above = []
    while (
        number >= 2 and lines[number - 2].startswith(("#", "/*", " *")) and not re.match(r"#[a-z]", lines[number - 2])
    ):
        number -= 1
        above.insert(0, lines[number - 1].strip("#/* "))
    return " ".join(above)


def is_number(value: object) -> bool:
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else (value,)
    return any(isinstance(part, int | float) and not isinstance(part, bool) for part in parts)


def read_in_functions(tree: ast.Module) -> set[str]:
    """Names that a file's functions read, in defaults of their arguments, too."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.Lambda)]
    parts = [part for node in functions for part in ast.walk(node)]
    names = {part.id for part in parts if isinstance(part, ast.Name)}
    return names | {part.attr for part in parts if isinstance(part, ast.Attribute)}


def python_constants() -> list[Constant]:
    """Numbers at module level that functions of these files read, with those that C code gets from Python."""
    files = set(python_files()) | {path.parent / "native" / "__init__.py" for path in python_files()}
    trees = {path: ast.parse(path.read_text()) for path in sorted(files) if path.exists()}
    read = set[str]().union(*map(read_in_functions, trees.values()))
    found = []
    for path, tree in trees.items():
        parts = (PDVOL.name, *path.relative_to(PDVOL).with_suffix("").parts)
        module, lines = import_module(".".join(parts).removesuffix(".__init__")), path.read_text().splitlines()
        for node in tree.body:
            name = getattr(node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None), "id", "")
            if name.isupper() and name in read - LAYOUT and is_number(getattr(module, name)):
                comment = comment_of(lines, node.lineno, name, r"#(.*)")
                found.append(Constant(path.relative_to(PDVOL).as_posix(), name, comment))
    return found


def c_constants() -> list[Constant]:
    """Numbers at the top level of C files: macros, constants and enumerators."""
    found = []
    for path in c_files():
        lines = path.read_text().splitlines()
        for number, line in enumerate(lines, start=1):
            names = re.findall(r"^#define (\w+) +[-(]?\.?\d", line)
            names += re.findall(r"^(?:static )?const \w+ (\w+) = [-(]?\.?\d", line)
            names += re.findall(r"(\w+) = ", line) if line.startswith("enum {") else []
            comments = [comment_of(lines, number, name, r"/\*(.*)\*/") for name in names]
            place = path.relative_to(PDVOL).as_posix()
            found += [Constant(place, *each) for each in zip(names, comments, strict=True) if each[0] not in LAYOUT]
    return found


# ---- claims


def test_a_step_is_so_many_files():
    files = [path.relative_to(PDVOL).as_posix() for path in python_files()]
    assert len(files) <= FILES, files
    assert len(c_files()) <= C_FILES, c_files()


def test_a_step_is_so_many_constants_each_with_its_unit_and_reason():
    constants = [*python_constants(), *c_constants()]
    assert len(constants) <= CONSTANTS, [(constant.file, constant.name) for constant in constants]
    bare = [constant for constant in constants if not re.match(r"[^:]+: \S", constant.comment)]
    assert bare == [], "a constant's comment is its noun and unit, a colon, and its reason"
