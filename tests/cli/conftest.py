"""What tests of several commands begin with: a folder with scene files, mesh files and one finished run."""

import json
import shutil

import pytest

import runs
from cli_scenes import CUBE_OFF, FALL, SQUARE, pdvol, write
from pdvol.compiled import cache_folder
from variants import runs_in

SETTABLE = """

def scene(poisson=0.4, dt=0.01, steps=1):
    return Scene((Body((square(1), square(2)), NeoHookean(1e5, poisson)),), dt=dt, steps=steps)
"""


@pytest.fixture(scope="session")
def folder(tmp_path_factory, final_pictures):
    """A folder with the scene file and one finished run of it."""
    folder = tmp_path_factory.mktemp("runs")
    write(folder / "fall.py", FALL)
    with final_pictures():
        assert pdvol("run", folder / "fall.py", "--out", folder / "whole") == 0
    return folder


@pytest.fixture
def scene(folder):
    return folder / "fall.py"


@pytest.fixture
def whole(folder):
    return folder / "whole"


@pytest.fixture(scope="session")
def place(folder, tmp_path_factory):
    """A folder of all that a command line may name by mistake: scenes, files that are none, runs in which something is
    wrong. Refusals leave it as it is.
    """
    place = tmp_path_factory.mktemp("place")
    write(place / "fall.py", FALL)
    write(place / "s.py", SQUARE + SETTABLE)
    write(place / "cube.off", CUBE_OFF)
    write(place / "open.off", CUBE_OFF.replace("8 12 0", "8 11 0").rsplit("3 3 4 7\n", 1)[0])
    write(place / "file", "")
    write(place / "weightless.py", FALL.replace("loads=(Gravity((0.0, -9.81)),)", "loads=()"))
    (place / "binary.py").write_bytes(b"\xff\xfe\x00\x80")
    for name in ("empty", "full", "earlier", "folder.py", "folder.obj"):
        (place / name).mkdir()
    write(place / "earlier" / "study.json", '{"format": 1}')
    write(place / "full" / "precious.txt", "mine")
    wrong = {"other_dt": {"dt": 0.5}, "other_bodies": {"bodies": ["somebody"]}, "gone": {"scene_file": "gone.py"}}
    for name in ("whole", "broken", "stateless", *wrong):
        shutil.copytree(folder / "whole", place / name)
        info = json.loads((place / name / "run.json").read_text()) | {"scene_file": str(place / "fall.py")}
        write(place / name / "run.json", json.dumps(info | wrong.get(name, {})))
    write(place / "broken" / "run.json", "{broken")
    for level in (0, 1):
        runs.keep_states(place / "stateless" / "levels" / str(level), 0)
    return place


@pytest.fixture
def refuse(tmp_path, place, capfd, monkeypatch):
    """Runs a command line in the folder `place` and returns the one line that it is refused with. The exit code is 2,
    nothing is on standard output, and no file is written or changed.
    """
    monkeypatch.chdir(place)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def files():
        found = [path for root in (place, tmp_path) for path in root.rglob("*")]
        kept = [path for path in found if not {"cache", "__pycache__", "run.lock"} & set(path.parts)]
        return {path: path.stat().st_mtime_ns if path.is_file() else 0 for path in kept}

    def refuse_(*words):
        before = files()
        capfd.readouterr()
        assert pdvol(*words) == 2
        out, err = capfd.readouterr()
        assert out == "" and err.startswith("pdvol: ") and err.count("\n") == 1, (out, err)
        assert files() == before, "something was written"
        return err

    return refuse_


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Gives the run of a variant by its name, made once; `made.run` makes others."""
    return runs_in(tmp_path_factory.mktemp("variants"))


@pytest.fixture
def own_meshes(tmp_path, monkeypatch):
    """An empty cache of meshes. Compiled code stays where it always is: processes would compile it again."""
    (tmp_path / "cache" / "pdvol").mkdir(parents=True)
    (tmp_path / "cache" / "pdvol" / "compiled").symlink_to(cache_folder().parent)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
