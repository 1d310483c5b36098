"""Scene files are loaded as Python loads a module, each with the modules that lie beside it as they are now."""

import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

from pdvol.errors import InputError
from pdvol.meshing.readers import read_shape
from pdvol.processes import Process
from pdvol.runs.scene_file import load_shot
from pdvol.runs.scene_modules import load_module

NEEDS_ITS_MODULE = """
from __future__ import annotations
import pickle
import typing
from collections import namedtuple
from dataclasses import KW_ONLY, InitVar, dataclass
from enum import Enum

@dataclass(slots=True, frozen=True)
class Part:
    count: typing.ClassVar[int] = 3
    _: KW_ONLY
    size: float = 1.0
    scale: InitVar[float] = 2.0

class Other:
    part: Part

Pair = namedtuple("Pair", "one other")

class Side(Enum):
    LEFT = 2.0

assert typing.get_type_hints(Other) == {"part": Part}
found = len(Part.__slots__) + pickle.loads(pickle.dumps(Pair(1.0, Side.LEFT))).other.value
"""
"""Dataclasses, hints and pickles look for a file's module."""


def test_a_file_finds_itself_among_the_modules(tmp_path):
    (tmp_path / "shot.py").write_text(NEEDS_ITS_MODULE)
    assert load_module(tmp_path / "shot.py").found == 3.0
    (tmp_path / "beside.py").write_text(NEEDS_ITS_MODULE)
    (tmp_path / "other.py").write_text("from beside import found")
    assert load_module(tmp_path / "other.py").found == 3.0


def test_processes_do_not_find_modules_beside_a_scene(tmp_path):
    load_module(written(tmp_path, "a module of a module", 1))
    process = Process()
    process.begin(find_spec, "second")
    assert find_spec("second") and process.answer(60.0) == (True, None)
    process.stop()


def test_a_file_that_fails_is_no_module(tmp_path):
    (tmp_path / "broken_shot.py").write_text("import sys\n1 / 0")
    with pytest.raises(InputError, match="ZeroDivisionError"):
        load_module(tmp_path / "broken_shot.py")
    assert "pdvol_scene_broken_shot" not in sys.modules


WAYS = {
    "import": ("import helpers\ndef value(): return helpers.VALUE", "helpers.py"),
    "from": ("from helpers import VALUE\ndef value(): return VALUE", "helpers.py"),
    "in a function": ("def value():\n    import helpers\n    return helpers.VALUE", "helpers.py"),
    "from, in a function": ("def value():\n    from helpers import VALUE\n    return VALUE", "helpers.py"),
    "a package": ("import helpers.deep\ndef value(): return helpers.deep.VALUE", "helpers/deep.py"),
    "a folder": ("from folder.deep import VALUE\ndef value(): return VALUE", "folder/deep.py"),
    "a module of a module": ("import first\ndef value(): return first.value()", "second.py"),
    "a module with the scene's name": ("def value():\n    import shot\n    return shot.VALUE\nVALUE = NONE", "none"),
}


def written(folder, way, value):
    """A scene file in a folder, whose `value()` reads a module beside it."""
    text, place = WAYS[way]
    (folder / place).parent.mkdir(parents=True, exist_ok=True)
    (folder / "shot.py").write_text(text.replace("NONE", str(value)))
    (folder / "first.py").write_text("def value():\n    import second\n    return second.VALUE")
    if place.startswith("helpers/"):
        (folder / "helpers" / "__init__.py").touch()
    (folder / place).write_text(f"VALUE = {value}")
    return folder / "shot.py"


@pytest.mark.parametrize("way", WAYS)
def test_a_scene_has_the_modules_beside_it_as_they_are_now(tmp_path, way):
    """Also where another scene's have the same name, or one was edited, as long as before in the same second; what was
    loaded before stays as it is.
    """
    one, other = (load_module(written(tmp_path / name, way, value)) for name, value in (("a", 1), ("b", 2)))
    assert [one.value(), other.value(), one.value(), other.value()] == [1, 2, 1, 2]
    now = load_module(written(tmp_path / "a", way, 3))
    assert [now.value(), one.value(), other.value()] == [3, 1, 2]
    assert not list(tmp_path.rglob("*.pyc"))


def test_modules_of_the_program_itself_stay(tmp_path):
    (tmp_path / "shot.py").write_text("import helpers, json\nfound = helpers")
    (tmp_path / "helpers.py").touch()
    program = "import sys, json, helpers\nfrom pathlib import Path\nfrom pdvol.runs.scene_modules import load_module\n"
    program += "assert load_module(Path('shot.py')).found is helpers is load_module(Path('shot.py')).found\n"
    program += "before = dict(sys.modules)\nload_module(Path('shot.py'))\n"
    program += "assert all(sys.modules[name] is module for name, module in before.items() if 'shot' not in name)"
    ended = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr


def test_files_lie_beside_the_scene_file_or_in_the_working_folder(tmp_path, monkeypatch):
    """Also those that a function of the scene reads; a path that is nowhere has both places in its line."""
    home, work = tmp_path / "home", tmp_path / "work"
    home.mkdir()
    work.mkdir()
    for folder, names in ((home, ("near.off", "both.off")), (work, ("both.off", "far.off"))):
        for name in names:
            (folder / name).write_text(TETRAHEDRON)
    (home / "scene.py").write_text(
        "import pdvol\n\ndef scene():\n    group = pdvol.VertexGroup('near.off', 'near.txt')\n"
        "    held = pdvol.Support(lambda X: group(X))\n"
        "    body = pdvol.Body(('near.off', 'both.off', 'far.off', 'none.off'), pdvol.NeoHookean(1e4), (9,) * 4)\n"
        "    return pdvol.Scene((body,), 0.01, 1, supports=(held,))\n"
    )
    monkeypatch.chdir(work)
    scene = load_shot(home / "scene.py").scene
    *found, none = scene.bodies[0].shape
    assert found == [str(home / "near.off"), str(home / "both.off"), "far.off"]
    assert len(read_shape(found[2]).vertices) == 4
    with pytest.raises(InputError, match=f"^{home / 'none.off'}: there is no such file; .*, {work}$"):
        read_shape(none)
    (home / "near.txt").write_text("1\n" * 4)
    assert scene.supports[0].where(np.zeros((1, 3))).all()


TETRAHEDRON = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
