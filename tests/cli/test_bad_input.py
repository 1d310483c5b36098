"""A user's mistake ends with exit code 2 and one line. The line says what is wrong, where it is and how to correct it.
There is no traceback and no half-written file.
"""

import os
import re
import subprocess
import sys

import numpy as np
import pytest

from cli_scenes import CUBE_OFF, FALL, SQUARE, pdvol, write
from commands import SAFETY


@pytest.fixture
def refuse(tmp_path, capfd, monkeypatch):
    """Runs a command line, checks that it fails as promised, and returns the one line that it printed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def refuse_(*words, code=2):
        before = {p for p in tmp_path.rglob("*") if "cache" not in p.parts}
        capfd.readouterr()
        assert pdvol(*words) == code
        out, err = capfd.readouterr()
        lines = err.strip("\n").split("\n")
        assert len(lines) == 1, err
        assert lines[0].startswith("pdvol: ")
        assert "Traceback" not in out + err
        after = {p for p in tmp_path.rglob("*") if not {"cache", "__pycache__"} & set(p.parts)}
        assert after == before, "something was left behind"
        return lines[0]

    return refuse_


def scene_of(shape, vertices="vertices=(20, 40)", more="", extra_bodies="", steps="1", dt="0.01"):
    """A scene file around one shape."""
    return (
        SQUARE
        + f"""

def scene(poisson=0.4, dt={dt}, steps={steps}):
    body = Body({shape}, NeoHookean(1e5, poisson), {vertices})
    return Scene(bodies=(body, {extra_bodies}), dt=dt, steps=steps, {more})
"""
    )


# ---- files


@pytest.mark.parametrize("command", ["run", "preview", "check", "info"])
def test_no_scene_file(refuse, command):
    assert "there is no scene file nowhere.py" in refuse(command, "nowhere.py")


@pytest.mark.parametrize("shape", ["nowhere.obj", "shape.docx", "nowhere.msh"])
def test_a_missing_shape(refuse, tmp_path, shape):
    line = refuse("run", write(tmp_path / "s.py", scene_of(f"'{shape}'")))
    assert shape in line


def test_a_shape_that_may_not_be_read(refuse, tmp_path):
    (tmp_path / "folder.obj").mkdir()
    assert "folder.obj" in refuse("run", write(tmp_path / "s.py", scene_of("'folder.obj'")))
    if os.getuid() != 0:
        write(tmp_path / "locked.off", CUBE_OFF).chmod(0)
        assert "permission" in refuse("run", write(tmp_path / "t.py", scene_of("'locked.off'")))


# ---- shapes


def off(points, triangles):
    return "\n".join(
        [
            "OFF",
            f"{len(points)} {len(triangles)} 0",
            *(" ".join(map(str, p)) for p in points),
            *("3 " + " ".join(map(str, t)) for t in triangles),
            "",
        ]
    )


def cube():
    lines = CUBE_OFF.split("\n")
    return [tuple(map(float, line.split())) for line in lines[2:10]], [
        tuple(map(int, line.split()[1:])) for line in lines[10:22]
    ]


@pytest.mark.parametrize(
    ("shape", "told"),
    [
        ("(square(2), 'x')", "x"),
        ("(3,)", "shape"),
        ("()", "empty"),
        ("(Outline(np.eye(2)),)", "volume meshes"),
        ("(Solid(np.zeros((0, 2)), np.zeros((0, 3), int), np.zeros(0, int)),)", "empty"),
    ],
    ids=["no mesh", "a number", "an empty list", "an outline in a list", "no cells"],
)
def test_what_is_no_list_of_meshes(refuse, tmp_path, shape, told):
    assert told in refuse("run", write(tmp_path / "s.py", scene_of(shape, vertices="")))


# ---- t = 0

TWO = (
    "Body((square(2), square(3)), NeoHookean(1e5), name='other', placement=Placement(translate={place},"
    " scale={scale})),"
)


def test_bodies_that_cross(refuse, tmp_path):
    text = scene_of(
        "(square(2), square(3))", "name='one'", "contact=(Barrier(),)", TWO.format(place=(0.5, 0.6), scale=1.0)
    )
    line = refuse("run", write(tmp_path / "s.py", text))
    assert "level 0: body " in line and "'one'" in line and "'other'" in line and "edge (" in line
    text = scene_of(
        "(square(2), square(3))", "name='one'", "contact=(Barrier(),)", TWO.format(place=(0.35, 0.35), scale=0.1)
    )
    assert "body 'other' lies inside body 'one'" in refuse("run", write(tmp_path / "t.py", text))


def test_bodies_that_cross_on_the_fine_level_only(refuse, tmp_path):
    fine = "Solid(square(2).vertices * (1.5, 1.0), square(2).cells, square(2).regions)"
    text = scene_of(
        f"(square(2), {fine})", "name='one'", "contact=(Barrier(),)", TWO.format(place=(1.2, 0.1), scale=1.0)
    )
    assert "level 1: body " in refuse("run", write(tmp_path / "s.py", text))


@pytest.mark.parametrize(
    ("obstacle", "told"),
    [
        ("Plane((0.0, 0.4), (0.0, 1.0), name='floor')", ("level 0", "plane 'floor'", "body 'one'", "vertex")),
        ("Plane((0.0, 0.0), (0.0, 1.0), name='floor')", ("level 0", "plane 'floor'", "at or below")),
        ("Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), name='floor')", ("plane 'floor'", "3D")),
        (
            "Rigid(Outline(np.array([(0.5, -0.5), (2, -0.5), (2, 0.5), (0.5, 0.4)])), name='rock')",
            ("level 0", "body 'one'", "obstacle 'rock'", "edge ("),
        ),
        (
            "Rigid(Outline(np.array([(-9.0, -9), (9, -9), (9, 9), (-9, 9)])), name='room')",
            ("inside", "obstacle 'room'", "closed=False"),
        ),
        (
            "Rigid(Surface(np.eye(4)[:, :3], np.array([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])), name='rock')",
            ("obstacle 'rock'",),
        ),
    ],
)
def test_a_body_that_crosses_an_obstacle(refuse, tmp_path, obstacle, told):
    text = scene_of("(square(2), square(3))", "name='one'", f"obstacles=({obstacle},), contact=(Barrier(),)")
    line = refuse("run", write(tmp_path / "s.py", text))
    assert all(word in line for word in told), line


# ---- parameters


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--set", "poisson=0.5"], "poisson = 0.5"),
        (["--set", "poisson=0.7"], "poisson = 0.7"),
        (["--set", "poisson=nan"], "poisson"),
        (["--set", "dt=-0.01"], "dt = -0.01"),
        (["--set", "dt=0"], "dt = 0"),
        (["--set", "dt=fast"], "dt = 'fast'"),
        (["--set", "steps=-1"], "steps = -1"),
        (["--set", "steps=1.5"], "steps = 1.5"),
        (["--steps", "-3"], "steps = -3"),
        (["--set", "jelly=1"], "no parameter 'jelly'"),
        (["--set", "poisson"], "name=value"),
        (["--set", "a b=1"], "name=value"),
        (["--set", "tolerance=-1"], "Solver.tolerance"),
        (["--set", "linear=magic"], "Solver.linear"),
        (["--set", "max_iterations=0"], "max_iterations"),
        (["--set", "max_iterations=many"], "max_iterations"),
        (["--set", "max_halvings=99"], "max_halvings"),
        (["--set", "petsc=3"], "petsc"),
        (["--set", "petsc=-ksp_type nonsense"], "Unable to find requested KSP type nonsense"),
        (["--set", "petsc=-pc_type nonsense"], "Unable to find requested PC type nonsense"),
        (["--set", "petsc=-ksp_rtol 1e-6 -ksp_typ cg"], "PETSc makes no use of -ksp_typ"),
        (["--set", "weight=0.1"], "only the method tracks uses it, not progressive"),
        (["--levels", "0:\u00b2"], "'\u00b2' is not a whole number"),
        (["--set", "tolerance=Relative(-1)"], "Relative"),
        (["--set", "tolerance=Relative(x)"], "tolerance"),
        (["--levels", "0:7"], "levels 0:7 do not exist"),
        (["--levels", "2"], "levels 2:2 do not exist"),
        (["--levels", "1:0"], "levels 1:0"),
        (["--levels", "1"], "holds no run"),
        (["--levels", "x:2"], "not a whole number"),
        (["--levels", "-1:1"], "--levels"),
    ],
)
def test_parameters(refuse, tmp_path, words, told):
    text = scene_of("(square(1), square(2))", "")
    assert told in refuse("run", write(tmp_path / "s.py", text), "--out", "out", *_joined(words))


def _joined(words):
    """`--name=value`, as users write values that begin with a dash."""
    return [f"{words[0]}={words[1]}"]


@pytest.mark.parametrize(
    "words",
    [
        ["run", "s.py", "--method", "magic"],
        ["run", "s.py", "--prolongation", "magic"],
        ["run", "s.py", "--steps", "few"],
        ["run"],
        ["fly"],
        [],
        ["run", "s.py", "--wings"],
        ["refine", "runs/x"],
        ["hierarchy", "x.off"],
        ["check", "s.py", "--measure", "nan"],
        ["render", "runs/x", "--turn", "nan"],
    ],
)
def test_what_the_command_line_itself_refuses(tmp_path, monkeypatch, capfd, words):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "s.py", FALL)
    assert pdvol(*words) == 2
    err = capfd.readouterr().err
    assert err.startswith("pdvol: ") and err.count("\n") == 1 and "--help" in err
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    "scene",
    [
        "bodies=()",
        "bodies=(body, body)",
        "bodies=(body,), obstacles=(Plane((0, -1), (0, 1)),)",
        "bodies=(body,), contact=(Friction(0.1),)",
        "bodies=(body,), supports=(Support(lambda X: X[:, 0] < 0, body='nobody'),)",
        "bodies=(body,), contact=(Barrier(), Barrier())",
        "bodies=(body,), contact=(Barrier(-1.0),)",
        "bodies=(body,), contact=(Barrier(), Friction(-1.0))",
        "bodies=(body, Body((square(1),), soft, name='b'))",
        "bodies=(Body(square(2), soft, (20, 10)),)",
        "bodies=(Body(square(2), soft),)",
        "bodies=(Body(square(2), soft, (2,)),)",
        "bodies=(Body((square(2),), soft, velocity=(0, 0, 0)),)",
        "bodies=(Body((square(2),), soft, spin=(1, 0, 0)),)",
        "bodies=(Body((square(2),), soft, velocity=lambda X: X[0]),)",
        "bodies=(Body((square(2),), soft, velocity=lambda X: 1 / 0),)",
        "bodies=(Body((square(2),), soft, velocity=lambda X: np.nan * X),)",
        "bodies=(Body((square(2),), 1e5),)",
        "bodies=(Body((square(2),), NeoHookean(-1.0)),)",
        "bodies=(Body((square(2),), NeoHookean(1e300)),)",
        "bodies=(Body((square(2),), NeoHookean(pdvol.Keyed((0, 1), (1e5, 1e300)))),)",
        "bodies=(Body((square(2),), NeoHookean(1e5, 0.3, 0)),)",
        "bodies=(Body((square(2),), soft, placement=Placement(scale=-1)),)",
        "bodies=(Body((square(2),), soft, placement=Placement((0, 0, 0))),)",
        "bodies=(body,), loads=(Gravity((0, 0, -9.81)),)",
        "bodies=body",
        "bodies=(Body((square(1), square(2)), soft, velocity=('x', 0)),)",
        "bodies=(body,), loads=Gravity((0, -9.81))",
        "bodies=(body,), supports=(Support(lambda X: X[0] < 0),)",
        "bodies=(body,), supports=(Support(lambda X: 1 / 0),)",
        "bodies=(body,), contact=(Barrier(stiffness=np.inf),)",
        "bodies=(body,), loads=(Gravity((0, np.nan)),)",
        "bodies=(body,), obstacles=(Plane((0, -1), (0, 0)),), contact=(Barrier(),)",
        "bodies=(body,), obstacles=(Plane((0, np.nan), (0, 1)),), contact=(Barrier(),)",
        "bodies=(body,), supports=(Support(lambda X: X[:, 0] < 0.1, motion=lambda X, t: X[:, :1]),)",
        "bodies=(body,), supports=(Support(lambda X: X[:, 0] * np.nan),)",
        "bodies=(body,), supports=(Support(lambda X: np.flatnonzero(X[:, 0] < 1)),)",
        "bodies=(body,), supports=(Support(lambda X: X[:, 0] < 0.1, motion=lambda X, t: X * np.inf),)",
        "bodies=(body,), supports=(Support(lambda X: X[:, 0] < 0.1, motion=3),)",
        "bodies=(body,), supports=(Support(lambda X: X[:, 0] < 0.1, release=-1),)",
        "bodies=(body,), obstacles=(Plane((0, -1), (0, 1), motion=lambda X, t: X[:1]),), contact=(Barrier(),)",
        (
            "bodies=(body,), obstacles=(Plane((0, -1), (0, 1), motion=lambda X, t: X if t < 0.005 else X * np.nan),),"
            " contact=(Barrier(),)"
        ),
        (
            "bodies=(body,), obstacles=(Plane((0, -1), (0, 1), motion=lambda X, t: X + t * nothing),),"
            " contact=(Barrier(),)"
        ),
    ],
)
def test_nonsense_scenes(refuse, tmp_path, scene):
    text = (
        SQUARE
        + f"""
soft = NeoHookean(1e5)
body = Body((square(1), square(2)), soft)


def scene():
    return Scene({scene}, dt=0.01, steps=1)
"""
    )
    refuse("run", write(tmp_path / "s.py", text))


@pytest.mark.parametrize(
    ("text", "told"),
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
def test_broken_scene_files(refuse, tmp_path, text, told):
    assert told in refuse("run", write(tmp_path / "s.py", text))


def test_a_scene_file_that_is_none(refuse, tmp_path):
    assert "not a Python file" in refuse("run", write(tmp_path / "cube.off", CUBE_OFF))
    (tmp_path / "folder.py").mkdir()
    assert "folder.py" in refuse("run", "folder.py")
    (tmp_path / "binary.py").write_bytes(b"\xff\xfe\x00\x80")
    assert "binary.py" in refuse("run", "binary.py")


# ---- run folders


@pytest.fixture
def stored(tmp_path, monkeypatch):
    """A run of one step on level 0."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "fall.py", FALL)
    assert pdvol("run", "fall.py", "--levels", "0", "--steps", 1, "--out", "run") == 0
    return tmp_path / "run"


def test_a_folder_that_holds_a_run(refuse, stored):
    assert "--resume" in refuse("run", "fall.py", "--out", stored)
    assert "young: 20000.0 -> 30000.0" in refuse("run", "fall.py", "--out", stored, "--resume", "--set", "young=3e4")
    assert "velocity" in refuse("run", "fall.py", "--out", stored, "--resume", "--set", "velocity=(0.0, 0.0)")
    assert "method 'progressive', not 'direct'" in refuse(
        "run", "fall.py", "--out", stored, "--resume", "--method", "direct"
    )
    assert "levels 0:5 do not exist" in refuse("refine", stored, "--to", 5)
    assert "levels 0:-1" in refuse("refine", stored, "--to=-1")
    (stored.parent / "fall.py").unlink()
    assert "fall.py is gone" in refuse("refine", stored, "--to", 1)


def test_what_is_no_run(refuse, tmp_path, stored):
    (tmp_path / "empty").mkdir()
    for command in (["refine", "{}", "--to", "1"], ["render", "{}"], ["info", "{}"]):
        assert "does not exist" in refuse(*[w.format("nowhere") for w in command])
        assert "has no run.json" in refuse(*[w.format("empty") for w in command])
        refuse(*[w.format("fall.py") for w in command[:1]], "empty/..", *command[2:])
    (stored / "run.json").write_text("{broken")
    for command in (
        ["refine", stored, "--to", 1],
        ["render", stored],
        ["info", stored],
        ["run", "fall.py", "--out", stored, "--resume"],
    ):
        assert "run.json" in refuse(*command)


def test_render_of_what_is_not_there(refuse, stored):
    refuse("render", stored, "--levels", "0:4")
    refuse("render", stored, "-o", "picture.docx")
    write(stored.parent / "file", "")
    refuse("render", stored, "-o", "file/picture.png")


def test_an_out_that_cannot_be_written(refuse, tmp_path):
    write(tmp_path / "fall.py", FALL)
    write(tmp_path / "file", "")
    assert "file" in refuse("run", "fall.py", "--steps", 1, "--out", "file")
    assert "file" in refuse("run", "fall.py", "--steps", 1, "--out", "file/below")
    assert "/proc" in refuse("run", "fall.py", "--steps", 1, "--out", "/proc/nowhere")
    (tmp_path / "full").mkdir()
    write(tmp_path / "full" / "precious.txt", "mine")
    assert "full is not empty" in refuse("run", "fall.py", "--steps", 1, "--out", "full")
    write(tmp_path / "cube.off", CUBE_OFF)
    assert "not a whole number" in refuse("hierarchy", "cube.off", "--levels", "20,few", "-o", "out")


def test_hierarchy_and_check_of_bad_meshes(refuse, tmp_path, capfd):
    points, triangles = cube()
    write(tmp_path / "open.off", off(points, triangles[:-1]))
    assert "open along" in refuse("hierarchy", "open.off", "--levels", "20", "-o", "out")
    assert "nowhere.off" in refuse("hierarchy", "nowhere.off", "--levels", "20", "-o", "out")
    capfd.readouterr()
    write(tmp_path / "good.off", CUBE_OFF)
    assert pdvol("check", "open.off", "good.off", "nowhere.off") == 2
    out, err = capfd.readouterr()
    assert err == "" and [line.split(":")[0] for line in out.splitlines()] == ["defect", "good.off", "defect"]


@pytest.mark.parametrize("words", [["run", "s.py"], ["check", "s.py"]], ids=" ".join)
def test_as_a_program(tmp_path, words):
    # What the shell sees: the code, one line, nothing on disk.
    write(
        tmp_path / "s.py",
        scene_of("(square(2), square(3))", "", "obstacles=(Plane((0.0, 0.5), (0.0, 1.0)),), contact=(Barrier(),)"),
    )
    ended = subprocess.run(
        [sys.executable, "-c", "import pdvol; pdvol.main()", *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=SAFETY,
    )
    assert ended.returncode == 2
    # Where the machine is busy, loading takes a second and leaves a line before.
    said = [line for line in ended.stderr.splitlines() if not re.fullmatch(r"loading (the solver|s\.py): .* s", line)]
    if words[0] == "run":
        assert len(said) == 1 and said[0].startswith("pdvol: level 0: ")
    else:
        assert said == [] and "defect at level 0" in ended.stdout
    assert sorted(p.name for p in tmp_path.iterdir() if p.name != "__pycache__") == ["s.py"]


def test_what_numpy_says_is_not_shown(refuse, tmp_path):
    # Coordinates beyond what squares can hold.
    points, triangles = cube()
    write(tmp_path / "huge.off", off((np.array(points) * 1e200).tolist(), triangles))
    refuse("run", write(tmp_path / "s.py", scene_of("'huge.off'")))
