"""A run folder from elsewhere: what reads it runs no code that it names, until the user has said so."""

import json
import shutil

import pytest

from cli_scenes import FALL, pdvol, write

TRAP = """
from pathlib import Path
Path(__file__).with_name("sprung").touch()
"""


@pytest.fixture(scope="module")
def theirs(tmp_path_factory):
    """The folder in which another user made a run, whose scene file does more than a scene."""
    folder = tmp_path_factory.mktemp("theirs")
    scene = write(folder / "fall.py", TRAP + FALL)
    words = ("--steps", 3, "--no-picture", "--no-xdmf", "-o", folder / "run")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        assert pdvol("run", scene, *words) == 0 == pdvol("metrics", folder / "run")
    (folder / "sprung").unlink()
    return folder


@pytest.fixture
def strange(theirs, tmp_path, monkeypatch):
    """A copy of their run, with its scene file beside it; nothing has run here."""
    shutil.copy(theirs / "fall.py", tmp_path)
    run = shutil.copytree(theirs / "run", tmp_path / "run")
    names(run, tmp_path / "fall.py")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "ours"))
    return run


def names(run, scene_file):
    """Let a run name this scene file."""
    info = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps({**info, "scene_file": str(scene_file)}))


@pytest.mark.parametrize(
    ("words", "noted"),
    [
        (("metrics",), "no continuity"),
        (("export", "--format", "xdmf", "-o", "out"), "without contact forces and stresses"),
        (("play", "--fields", "contact_force", "-o", "p.html"), "without contact forces and stresses"),
    ],
    ids=["metrics", "export", "play"],
)
def test_its_scene_file_is_not_run_unseen(strange, capsys, monkeypatch, words, noted):
    monkeypatch.chdir(strange.parent)
    command, *options = words
    sprung = strange.with_name("sprung")
    for more, springs in (((), False), (("--trust",), True), ((), True)):
        sprung.unlink(missing_ok=True)
        capsys.readouterr()
        assert pdvol(command, strange, *options, *more) == 0
        assert sprung.exists() == springs
        said = capsys.readouterr().out
        assert (noted in said and "fall.py has not run here as it is now" in said) == (not springs)


def test_reading_states_runs_nothing(strange):
    for words in (("info",), ("verify",), ("render",), ("play",)):
        assert pdvol(*words, strange) == 0
    assert not strange.with_name("sprung").exists()


def test_a_file_that_has_changed_is_not_known(strange, capsys):
    """Nor is one of the same content elsewhere, whose modules beside it are others."""
    scene = strange.with_name("fall.py")
    assert pdvol("info", scene) == 0
    (strange.parent / "else").mkdir()
    shutil.copy(scene, strange.parent / "else" / "fall.py")
    scene.write_text(scene.read_text() + "# edited")
    for file in (scene, strange.parent / "else" / "fall.py"):
        names(strange, file)
        capsys.readouterr()
        assert pdvol("metrics", strange) == 0
        assert "has not run here as it is now" in capsys.readouterr().out
