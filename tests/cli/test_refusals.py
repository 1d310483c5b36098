"""A user's mistake ends with exit code 2 and one line. The line says what is wrong, where it is and how to correct it.
There is no traceback and no half-written file.
"""

import os
import re
import shlex
import subprocess
import sys

import pytest

from cli_scenes import CUBE_OFF, SQUARE, write
from commands import SAFETY

COMMANDS = """
run nowhere.py                                        | there is no scene file nowhere.py
check nowhere.py                                      | there is no scene file nowhere.py
run cube.off                                          | not a Python file
run folder.py                                         | folder.py
run binary.py                                         | binary.py

run s.py --out out --set poisson=0.5                  | poisson = 0.5
run s.py --out out --set dt=-0.01                     | dt = -0.01
run s.py --out out --set dt=fast                      | dt = 'fast'
run s.py --out out --set steps=-1                     | steps = -1
run s.py --out out --set steps=1.5                    | steps = 1.5
run s.py --out out --steps=-3                         | steps = -3
run s.py --out out --set jelly=1                      | no parameter 'jelly'
run s.py --out out --set poisson                      | name=value
run s.py --out out --set tolerance=-1                 | Solver.tolerance
run s.py --out out --set tolerance=Relative(-1)       | Relative
run s.py --out out --set linear=magic                 | Solver.linear
run s.py --out out --set max_iterations=0             | max_iterations
run s.py --out out --set max_halvings=99              | max_halvings
run s.py --out out --set petsc=3                      | petsc
run s.py --out out --set "petsc=-ksp_type nonsense"   | Unable to find requested KSP type nonsense
run s.py --out out --set "petsc=-ksp_typ cg"            | PETSc makes no use of -ksp_typ
run s.py --out out --set weight=0.1                   | only the method tracks uses it, not progressive
run s.py --out out --set weight=much                  | Penalty.weight = 'much' is not a finite number
run s.py --out out --method tracks                    | tracks needs a weight above zero
run s.py --out out --set consistency=-1               | Penalty.consistency = -1 is below 0
run s.py --out out --set feedback=1.5                 | feedback = 1.5 must be at most 1
run s.py --out out --set integrator=rk4               | unknown integrator 'rk4'; choose one of bdf2, implicit_euler
run s.py --out out --set integrator=[1]               | unknown integrator
run s.py --out out --levels 0:\u00b2                  | '\u00b2' is not a whole number
run s.py --out out --levels 0:7                       | levels 0:7 do not exist
run s.py --out out --levels 1:0                       | levels 1:0
run s.py --out out --levels 1                         | holds no run
run s.py --out out --levels x:2                       | not a whole number
run s.py --out out --levels=-1:1                      | --levels
run s.py --out out --ranks 0                          | --ranks 0
run s.py --out out --accuracy 5mm                     | needs a study: pdvol study
run s.py --out out --accuracy 5mm --study nowhere     | holds no study
run s.py --out out --accuracy 5mm --study earlier     | earlier holds no study of this pdvol; make one by: pdvol study
preview s.py --watch --resume                         | leave out --resume

run s.py --prolongation magic                         | --help
run                                                   | --help
                                                      | --help
run s.py --fast                                       | unrecognized arguments: --fast; see pdvol run --help
refine whole                                          | --help
hierarchy cube.off                                    | --help
render whole --turn nan                               | --help

run s.py --out file                                   | file is a file, not a folder
run s.py --out /proc/nowhere                          | /proc
run s.py --out full                                   | full is not empty
hierarchy cube.off --levels 20,few -o out             | not a whole number
hierarchy open.off --levels 20 -o out                 | open along
check s.py --measure=-1                               | --measure
check s.py -o s.py/below                              | s.py
check s.py --json nowhere/found.json                  | found.json

run fall.py --out whole                               | --resume
run fall.py --out whole --resume --set young=3e4 --set mu=0.5 | scene.contact[1].mu: 0.3 -> 0.5
run fall.py --out whole --resume --set sizes=(3,4)    | shape[0].vertices: an array of shape (9, 2) -> (16, 2)
run fall.py --out whole --resume --set sizes=(2,)     | holds 2 levels, the scene has 1 now
run fall.py --out whole --resume --set consistency=.3 | scene.penalty
run fall.py --out whole --resume --set integrator=implicit_euler | scene.integrator: bdf2 -> implicit_euler
run weightless.py --out whole --resume                | scene.loads: 1 -> 0 entries
run fall.py --out whole --resume --method direct      | method 'progressive', not 'direct'
run fall.py --out whole --resume --prolongation phong | was run with prolongation 'barycentric', not 'phong'
preview fall.py --out whole                           | holds a run of 2 levels; choose another folder
refine whole --to 5                                   | levels 0:5 do not exist
refine whole --to=-1                                  | levels 0:-1
refine gone --to 1                                    | gone.py is gone
refine empty --to 1                                   | has no run.json
run fall.py --out broken --resume                     | run.json
info broken                                           | run.json
render empty                                          | has no run.json
render whole --levels 0:4                             | no stored state of level 2
render whole -o picture.docx                          | picture.docx
render whole -o file/picture.png                      | file
verify whole empty                                    | empty is not a run folder: it has no run.json
verify whole --every 0                                | --every
metrics whole --against empty                         | is not a run folder
metrics whole --json .                                | cannot be written
metrics whole --against other_dt                      | same time step
metrics whole --against other_bodies                  | different bodies
metrics stateless                                     | no stored state
play whole -o shot.mp4                                | ends in .html
play whole -o shot.html --levels 0:4                  | has levels 0 to 1
play whole -o shot.html --every 0                     | --every: 0 is too small
play whole -o shot.html --fields heat                 | choose of strain, contact_force

run fall.py --out b --branch whole --at 4 --set sizes=(3,5)  | another mesh or placement
run fall.py --out b --branch whole --at 4 --set dt=0.01      | another dt
run fall.py --out b --branch whole --at 11                   | no step 11
run fall.py --out b --branch whole --at 4 --steps 4          | end of the shot
run fall.py --out b --branch whole --at 4 --resume           | leave out --resume
run fall.py --out b --branch whole --at 4 --method direct    | progressive

study fall.py -o s --vary colour                             | needs values
study fall.py -o s --vary colour=1:2                         | no parameter 'colour'
study fall.py -o s --vary dt,dt                              | twice
study fall.py -o s --vary dt=0.01,0.02 --vary dt=0.03        | twice
study fall.py -o s --vary level=1                            | give level by --levels
study fall.py -o s --vary dt=0.02,0.01,integrator=bdf2       | a --vary of its own
study fall.py -o s --vary dt=0.02:0.01:half                  | N in A:B:N
study fall.py -o s --vary dt=0.02,level                      | dt
study fall.py -o s --vary dt=                                | --vary dt=
study fall.py -o s --budget 0                                | above zero
study fall.py -o s --levels 1:1                              | begins with level 0
study fall.py -o s --levels 0:7                              | does not exist
study fall.py -o s --reference dt                            | write name=value
"""
"""Command lines, each with a part of its answer."""
LINES = [[part.strip() for part in line.rsplit("|", 1)] for line in COMMANDS.splitlines() if line]


@pytest.mark.parametrize(("line", "printed"), LINES)
def test_command_lines(refuse, line, printed):
    assert printed in refuse(*shlex.split(line))


# ---- scenes

SCENE = (
    SQUARE
    + """
soft = NeoHookean(1e5)
body = Body((square(1), square(2)), soft)


def of(shape, vertices=(20, 40), **more):
    return Body(shape, soft, vertices, **more)


def two(place, scale=1.0, first=(square(2), square(3))):
    return (of(first, (), name="one"),
            of((square(2), square(3)), (), name="other", placement=Placement(translate=place, scale=scale)))


def scene(steps=1):
    return Scene({}, dt=0.01, steps=steps)
"""
)
BARRIER = "contact=(Barrier(),)"
SCENES = {
    # shapes
    "(of('nowhere.obj'),)": "nowhere.obj",
    "(of('shape.docx'),)": "shape.docx",
    "(of('folder.obj'),)": "folder.obj",
    "(of('huge.off'),)": "",
    "(of((square(2), 'x'), ()),)": "x",
    "(of((3,), ()),)": "shape",
    "(of((Outline(np.eye(2)),), ()),)": "volume meshes",
    "(of((Solid(np.zeros((0, 2)), np.zeros((0, 3), int), np.zeros(0, int)),), ()),)": "empty",
    "(of(square(2), (20, 10)),)": "",
    "(of(square(2), ()),)": "",
    "(of(square(2), (2,)),)": "",
    # t = 0
    f"two((0.5, 0.6)), {BARRIER}": "level 0: body 'one' crosses body 'other'.*edge \\(",
    f"two((0.35, 0.35), 0.1), {BARRIER}": "body 'other' lies inside body 'one'",
    f"two((1.2, 0.1), 1.0, (square(2), Solid(square(2).vertices * (1.5, 1.0), square(2).cells, square(2).regions))), "
    f"{BARRIER}": "level 1: body ",
    f"two((9, 9)), obstacles=(Plane((0, 0.4), (0, 1), name='floor'),), {BARRIER}": (
        "level 0.*plane 'floor'.*vertex.*body 'one'"
    ),
    f"two((9, 9)), obstacles=(Plane((0, 0), (0, 1), name='floor'),), {BARRIER}": "level 0.*at or below.*plane 'floor'",
    f"two((9, 9)), obstacles=(Plane((0, -1, 0), (0, 1, 0), name='floor'),), {BARRIER}": "plane 'floor'.*3D",
    "two((9, 9)), obstacles=(Rigid(Outline(np.array([(0.5, -0.5), (2, -0.5), (2, 0.5), (0.5, 0.4)])), name='rock'),), "
    f"{BARRIER}": "level 0.*body 'one'.*obstacle 'rock'.*edge \\(",
    f"(body,), obstacles=(Rigid(Outline(np.array([(-9.0, -9), (9, -9), (9, 9), (-9, 9)])), name='room'),), {BARRIER}": (
        "inside obstacle 'room'.*closed=False"
    ),
    "(body,), obstacles=(Rigid(Surface(np.eye(4)[:, :3], np.array([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])), "
    f"name='rock'),), {BARRIER}": "obstacle 'rock'",
    # arguments
    "()": "",
    "(body, body)": "",
    "body": "",
    "(body,), obstacles=(Plane((0, -1), (0, 1)),)": "",
    "(body,), contact=(Friction(0.1),)": "",
    "(body,), supports=(Support(lambda X: X[:, 0] < 0, body='nobody'),)": "",
    "(body,), contact=(Barrier(), Barrier())": "",
    "(body,), contact=(Barrier(-1.0),)": "",
    "(body,), contact=(Barrier(), Friction(-1.0))": "",
    "(body, of((square(1),), (), name='b'))": "",
    "(of((square(2),), (), velocity=(0, 0, 0)),)": "",
    "(of((square(2),), (), velocity=('x', 0)),)": "",
    "(of((square(2),), (), velocity=lambda X: X[0]),)": "",
    "(of((square(2),), (), velocity=lambda X: 1 / 0),)": "",
    "(of((square(2),), (), spin=(1, 0, 0)),)": "",
    "(Body((square(2),), 1e5),)": "",
    "(Body((square(2),), NeoHookean(-1.0)),)": "",
    "(Body((square(2),), NeoHookean(pdvol.Keyed((0, 1), (1e5, 1e300)))),)": "",
    "(Body((square(2),), NeoHookean(1e5, 0.3, 0)),)": "",
    "(of((square(2),), (), placement=Placement(scale=-1)),)": "",
    "(of((square(2),), (), placement=Placement((0, 0, 0))),)": "",
    "(body,), loads=Gravity((0, -9.81))": "",
    "(body,), loads=(Gravity((0, 0, -9.81)),)": "",
    "(body,), loads=(Gravity((0, np.nan)),)": "",
    "(body,), supports=(Support(lambda X: X[0] < 0),)": "",
    "(body,), supports=(Support(lambda X: 1 / 0),)": "",
    "(body,), supports=(Support(lambda X: np.flatnonzero(X[:, 0] < 1)),)": "",
    "(body,), supports=(Support(lambda X: X[:, 0] < 0.1, motion=lambda X, t: X[:, :1]),)": "",
    "(body,), supports=(Support(lambda X: X[:, 0] < 0.1, motion=3),)": "",
    "(body,), supports=(Support(lambda X: X[:, 0] < 0.1, release=-1),)": "",
    f"(body,), obstacles=(Plane((0, -1), (0, 0)),), {BARRIER}": "",
    f"(body,), obstacles=(Plane((0, np.nan), (0, 1)),), {BARRIER}": "",
    f"(body,), obstacles=(Plane((0, -1), (0, 1), motion=lambda X, t: X[:1]),), {BARRIER}": "",
    f"(body,), obstacles=(Plane((0, -1), (0, 1), motion=lambda X, t: X if t < 0.005 else X * np.nan),), {BARRIER}": "",
    f"(body,), obstacles=(Plane((0, -1), (0, 1), motion=lambda X, t: X + t * nothing),), {BARRIER}": "",
}
"""The arguments of a scene, each with a pattern of its answer."""


@pytest.mark.parametrize("scene", SCENES)
def test_scenes(refuse, tmp_path, scene):
    (tmp_path / "folder.obj").mkdir()
    rows = [line.split() for line in CUBE_OFF.splitlines()[2:10]]  # beyond what squares can hold
    huge = [" ".join(f"{x}e200" for x in row) for row in rows]
    write(tmp_path / "huge.off", "\n".join([*CUBE_OFF.splitlines()[:2], *huge, *CUBE_OFF.splitlines()[10:], ""]))
    line = refuse("run", write(tmp_path / "s.py", SCENE.format(scene)))
    assert re.search(SCENES[scene], line), line


@pytest.mark.skipif(os.getuid() == 0, reason="root may read all files")
def test_a_shape_that_may_not_be_read(refuse, tmp_path):
    write(tmp_path / "locked.off", CUBE_OFF).chmod(0)
    assert "permission" in refuse("run", write(tmp_path / "s.py", SCENE.format("(of('locked.off'),)")))


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("def scene(:\n", "SyntaxError"),
        ("import nowhere_to_be_found\n", "ModuleNotFoundError"),
        ("x = 1 / 0\n", "ZeroDivisionError"),
        ("x = 3\n", "defines no scene"),
        ("scene = 3\n", "defines no scene"),
        ("def scene():\n    return 3\n", "returned int"),
        ("def scene():\n    pass\n", "returned NoneType"),
        ("def scene():\n    raise RuntimeError('two\\nlines')\n", "RuntimeError: two lines"),
        ("def scene(size):\n    return size\n", "size"),
        ("import sys\nsys.exit(3)\n", "s.py"),
        ("def scene():\n    raise SystemExit(0)\n", "s.py"),
        ("\x00", "s.py"),
        ("def scene():\n    return scene()\n", "Recursion"),
    ],
)
def test_broken_scene_files(refuse, tmp_path, text, printed):
    assert printed in refuse("run", write(tmp_path / "s.py", text))


# ---- beside the one line


def test_as_a_program(tmp_path):
    """What the shell sees of `python -m pdvol`: the code, one line, nothing on disk."""
    write(tmp_path / "s.py", SCENE.format(f"(body,), obstacles=(Plane((0, 0.5), (0, 1)),), {BARRIER}"))
    ended = subprocess.run(
        [sys.executable, "-m", "pdvol", "run", "s.py"], cwd=tmp_path, capture_output=True, text=True, timeout=SAFETY
    )
    assert ended.returncode == 2
    # Where the machine is busy, loading takes a second and leaves a line before.
    (line,) = [line for line in ended.stderr.splitlines() if not line.startswith("loading ")]
    assert line.startswith("pdvol: level 0: ")
    assert sorted(p.name for p in tmp_path.iterdir() if p.name != "__pycache__") == ["s.py"]
