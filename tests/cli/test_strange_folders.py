"""No name in a folder from elsewhere makes pdvol run or read a file outside of it, until the user says so by --trust.

The user has made a wedge of a scene; another wedge or study of that scene comes from elsewhere, with one name changed.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cli_scenes import FALL, pdvol, write
from pdvol.runs import known_scenes
from pdvol.runs.scene_file import load_shot
from pdvol.store.reader import open_run

SCENE = "from os import system\nimport beside\n" + FALL.replace("def scene(", "def scene(mark='', ").replace(
    "    return Scene(", "    if mark:\n        open(mark, 'w').close()\n    return Scene(", 1
)
TRAP = "from pathlib import Path\nPath({!r}).touch()\ndef scene(**k): pass\ndef score(run): return 1.0\n"
SHORT = ("--no-picture", "--no-xdmf")
COMMANDS = {
    "info": ("info", "w/0"),
    "verify": ("verify", "w/0"),
    "render": ("render", "w/0"),
    "play": ("play", "w/0", "-o", "p.html"),
    "play a wedge": ("play", "w", "-o", "p.html"),
    "play with forces": ("play", "w", "--fields", "contact_force", "-o", "p.html"),
    "metrics": ("metrics", "w/0"),
    "metrics against": ("metrics", "w/1", "--against", "w/0"),
    "export": ("export", "w/0", "--format", "xdmf", "-o", "out"),
    "export usd": ("export", "w/0", "--format", "obj", "-o", "out"),
    "refine": ("refine", "w/0", "--to", "1", *SHORT),
    "pick": ("pick", "w", "0", "-o", "picked", *SHORT),
    "pick the best": ("pick", "w", "best", "-o", "picked", *SHORT),
    "pick and refine": ("pick", "w", "0", "-o", "picked", "--refine", *SHORT),
    "a study's settings": ("run", "fall.py", "--study", "s", "--time", "1h", "-o", "new", *SHORT),
}
TRUSTING = [name for name, words in COMMANDS.items() if words[0] not in ("info", "verify", "render")]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("strange")
    work = folder / "work"
    work.mkdir()
    (work / "beside.py").touch()
    scene = write(work / "fall.py", SCENE)
    words = ("--steps", 2, "--vary", "height=0.02,0.03", "--score", "quiet()", "--no-picture", "--jobs", 1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(work / "state"))
        assert pdvol("wedge", scene, *words, "-o", work / "made") == 0
        (work / "made").rename(work / "w")  # as one from elsewhere
        shot = load_shot(scene)
    point = {
        "changes": {}, "words": ["--levels", "0:0", "--steps", "2"], "method": "progressive",
        "errors": {"end": 0.1, "outcome": True}, "cost": {"cpu": 1.0}, "label": "", "level": 0,
    }  # fmt: skip
    (work / "s").mkdir()
    study = {
        "description": {"scene": shot.description(), "steps": shot.scene.steps, "method": "progressive"},
        "method": "progressive", "points": [point], "reference": {"error": 0.0, "point": point}, "size": 1.0,
        "spread": {}, "format": 2,
    }  # fmt: skip
    (work / "s" / "study.json").write_text(json.dumps(study))
    shutil.copytree(work, folder / "kept")
    return folder


@pytest.fixture
def work(made, tmp_path, monkeypatch):
    """The user's folder as it was; `tmp_path` is outside of it."""
    shutil.rmtree(made / "work")
    monkeypatch.setenv("XDG_STATE_HOME", str(made / "work" / "state"))
    monkeypatch.setattr(known_scenes, "_here", set())  # as in a new process
    monkeypatch.chdir(shutil.copytree(made / "kept", made / "work"))
    (tmp_path / "trap.py").write_text(TRAP.format(str(tmp_path / "sprung")))
    return made / "work"


def changed(file, **keys):
    """A JSON file with other values; those of variations are `entry`, those of points `point`."""
    stored = json.loads(file.read_text())
    for entry in stored.get("variations", []):
        entry |= keys.get("entry", {})
    for point in stored.get("points", []):
        point |= keys.get("point", {})
    stored |= {key: value for key, value in keys.items() if key not in ("entry", "point")}
    file.write_text(json.dumps(stored))


def runs(work, **keys):
    for number in "01":
        changed(work / "w" / number / "run.json", **keys)


def moved_out(work, outside, name):
    """Move a file or folder out, and leave a link."""
    (work / name).rename(outside / "moved")
    (work / name).symlink_to(outside / "moved")


CHANGES = {
    "a scene elsewhere": lambda work, out: runs(work, scene_file=str(out / "trap.py")),
    "a scene by a link": lambda work, out: (
        (work / "fall.py").unlink() or (work / "fall.py").symlink_to(out / "trap.py")
    ),
    "another scene of that name": lambda work, out: shutil.copy(out / "trap.py", work / "fall.py"),
    "a module beside the scene": lambda work, out: shutil.copy(out / "trap.py", work / "beside.py"),
    "its copy beside another module": lambda work, out: (
        shutil.copy(work / "fall.py", out) and shutil.copy(out / "trap.py", out / "beside.py")
        and runs(work, scene_file=str(out / "fall.py"))
    ),
    "a module as a package": lambda work, out: (
        (work / "beside").mkdir() or shutil.copy(out / "trap.py", work / "beside" / "__init__.py")
    ),
    "a path in the settings": lambda work, out: (
        runs(work, parameters={"mark": str(out / "sprung")})
        or changed(work / "s" / "study.json", point={"changes": {"mark": str(out / "sprung")}})
    ),
    "a score elsewhere": lambda work, out: score(work, f"{out}/trap.py:score"),
    "a score by ..": lambda work, out: score(work, f"w/../../../{out.name}/trap.py:score"),
    "a score beside the wedge": lambda work, out: (
        shutil.copy(out / "trap.py", work / "w" / "t.py") and score(work, "w/t.py:score")
    ),
    "a score by a link": lambda work, out: (
        (work / "t.py").symlink_to(out / "trap.py") or score(work, f"{work}/t.py:score")
    ),
    "a function that it imports": lambda work, out: score(work, f"system('touch {out}/sprung')"),
}  # fmt: skip
RUNS_ANYTHING = {
    "scene": ("play with forces", "metrics", "metrics against", "export", "refine", "pick", "pick the best",
              "pick and refine"),
    "module": ("play with forces", "metrics", "metrics against", "export", "refine", "pick and refine",
               "a study's settings"),
    "path": ("refine", "pick and refine", "a study's settings"),
    "score": ("pick", "pick the best", "pick and refine"),
    "function": ("pick", "pick the best", "pick and refine"),
}  # fmt: skip
"""By a word of a change, the commands that would run what it names: with --trust they do, or fail at it."""


def score(work, text):
    changed(work / "w" / "wedge.json", entry={"scores": {text: 1.0}}, best={"number": 0, "score": 1.0, "of": text})


def paired(changes) -> list:
    """Each change with each command; left out of CI are all but one change of each word for a command, in turn."""
    found = []
    for change in changes:
        alike = [other for other in changes if kind_of(other) == kind_of(change)]
        for place, command in enumerate(COMMANDS):
            often = alike.index(change) == place % len(alike)
            found.append(pytest.param(change, command, marks=() if often else pytest.mark.slow))
    return found


def kind_of(change) -> str:
    return next((word for word in RUNS_ANYTHING if word in change), change)


@pytest.mark.parametrize(("change", "command"), paired(CHANGES))
def test_what_a_name_names_is_not_run_unseen(work, tmp_path, capsys, change, command):
    score(work, "quiet()")
    CHANGES[change](work, tmp_path)
    sprung, words = tmp_path / "sprung", COMMANDS[command]
    named_by_the_user = command == "a study's settings" and ("scene" in change or "module" in change)
    if not named_by_the_user:
        code = pdvol(*words)
        assert not sprung.exists()
        said = "".join(capsys.readouterr())
        assert "Traceback" not in said and not (work / "picked").exists() or code == 0
        assert code == 0 or "look at it, then add --trust" in said
    if command in TRUSTING:
        pdvol(*words, "--trust")
        would = next(names for word, names in RUNS_ANYTHING.items() if word in change)
        if command in would and not (named_by_the_user and not sprung.exists()):
            assert sprung.exists()


@pytest.mark.parametrize(
    ("command", "noted"),
    [
        ("metrics", "no continuity"),
        *((name, "without contact forces and stresses") for name in ("export", "play with forces")),
    ],
)
def test_the_rest_is_written_and_trust_lasts(work, tmp_path, capsys, command, noted):
    CHANGES["a module beside the scene"](work, tmp_path)
    for more, springs in (((), False), (("--trust",), True), ((), True)):
        (tmp_path / "sprung").unlink(missing_ok=True)
        capsys.readouterr()
        assert pdvol(*COMMANDS[command], *more) == 0
        assert (tmp_path / "sprung").exists() == springs
        said = "".join(capsys.readouterr())
        assert (noted in said and "has not run here as it is now" in said) == (not springs)


LINKS = {
    "states": lambda work, out: moved_out(work, out, "w/0/levels/0/states.bin"),
    "a mesh": lambda work, out: moved_out(work, out, "w/0/levels/0/mesh.npz"),
    "a level": lambda work, out: moved_out(work, out, "w/0/levels/0"),
    "the log": lambda work, out: moved_out(work, out, "w/0/log.jsonl"),
    "what is written": lambda work, out: (work / "w/0/metrics.png").symlink_to(out / "trap.py"),
    "a run": lambda work, out: moved_out(work, out, "w/0"),
    "run.json": lambda work, out: moved_out(work, out, "w/0/run.json"),
    "a name by ..": lambda work, out: (
        (work / "w/0").rename(out / "moved")
        or (work / "w" / "runs").mkdir()
        or changed(work / "w/wedge.json", entry={"name": f"../../../../{out.name}/moved"})
    ),
    "an absolute name": lambda work, out: (
        (work / "w/0").rename(out / "moved") or changed(work / "w/wedge.json", entry={"name": str(out / "moved")})
    ),
    "a number by ..": lambda work, out: (
        (work / "w/0").rename(out / "moved")
        or changed(work / "w/wedge.json", entry={"number": f"../../../{out.name}/moved"})
    ),
    "wedge.json": lambda work, out: moved_out(work, out, "w/wedge.json"),
    "study.json": lambda work, out: moved_out(work, out, "s/study.json"),
}  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("link", LINKS)
def test_what_lies_outside_is_neither_read_nor_written(work, tmp_path, capsys, link, command):
    words = COMMANDS[command]
    of_wedge = link in ("wedge.json", "a run") or "name" in link or "number" in link  # else a run is named by itself
    if not ("--study" in words if link == "study.json" else words[1] == "w" if of_wedge else words[1][0] == "w"):
        pytest.skip("it does not read this")
    changed(work / "w" / "wedge.json", best={"number": 0, "score": 1.0, "of": "quiet()"})
    LINKS[link](work, tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    code, said = pdvol(*words), "".join(capsys.readouterr())
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before
    assert "Traceback" not in said and not (work / "picked").exists()
    assert code in (1, 2) or "w" == words[1] and not Path("picked").exists()


def test_the_users_own_folders_need_no_trust(work):
    """Nor those that were made with a score of a file, a module beside the scene, and a text among the settings."""
    write(work / "good.py", "def score(run): return 1.0")
    words = ("--steps", 2, "--vary", f"mark={work}/a,{work}/b", "--score", "good.py:score", "--no-picture", "--jobs", 1)
    assert pdvol("wedge", "fall.py", *words, "-o", "v") == 0
    assert pdvol("pick", "v", 0, "-o", "picked", "--refine", *SHORT) == 0
    assert pdvol("refine", "v/1", "--to", 1, *SHORT) == 0
    assert pdvol("run", "fall.py", "--study", "s", "--time", "1h", "-o", "new", *SHORT) == 0


def test_files_in_the_working_folder_are_no_modules_of_pdvol(work, tmp_path):
    """Nor of the processes that it starts. Values reach these to the last bit."""
    for name in ("numpy.py", "tqdm.py", "mpi4py.py", "json.py"):
        shutil.copy(tmp_path / "trap.py", work / name)
    words = ("wedge", "fall.py", "--steps", "2", "--vary", f"dt={1 / 240!r},{1 / 120!r}", "--set", f"young={1e4 / 3!r}")
    more = ("--no-picture", "--jobs", "1", "-o", "v")
    ended = subprocess.run([sys.executable, "-P", "-m", "pdvol", *words, *more], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert not (tmp_path / "sprung").exists()
    found = [open_run(work / "v" / str(number)).info for number in range(2)]
    assert [info["dt"] for info in found] == [1 / 240, 1 / 120]
    assert [info["parameters"]["young"] for info in found] == [1e4 / 3, 1e4 / 3]
