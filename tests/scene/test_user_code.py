"""A scene's description has what its functions read: an edit of any of it is another scene, and nothing else is."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import pdvol
from pdvol.runs.fingerprint import describe, differences, not_compared
from pdvol.runs.scene_file import load_shot

HELPERS = """
import settings

REACH = 0.5

def eased(t):
    return REACH * settings.pace(t)
"""
SETTINGS = """
PACE = 2.0

def pace(t):
    return PACE * t
"""
SCENE = """
import functools
import math

import numpy as np
import pdvol
import helpers
from helpers import eased
from scipy.interpolate import CubicSpline

SPEED = 0.1
SIDES = {"left", "right", "top"}
TABLE = np.array([0.0, 1.0])
KEYS = {"start": 0.5}


def push(X, t, far=1.0):
    return X + SPEED * t * (len(SIDES) > 2)


def scaled(X, t, by):
    return X * (1.0 + by * TABLE[1] * t)


class Rig:
    LIFT = 0.3

    def __init__(self, gain):
        self.gain, self.keys = gain, KEYS

    def __call__(self, X, t):
        return X + self.gain * self.move(t)

    def move(self, t):
        return self.keys["start"] * WEIGHT * eased(t)

    def pose(self, X, t):
        return X + self.gain


WEIGHT = 1.5
curve = CubicSpline([0.0, 1.0, 2.0], [0.0, 0.5, 1.0])


@functools.cache
def height(t):
    return HIGH * t


HIGH = 0.4
rig = Rig(0.2)


def scene(young=1e5):
    where = lambda X: X[:, 0] < 0.0
    shape = pdvol.Solid(np.array([[0.0, 0], [1, 0], [0, 1]]), np.array([[0, 1, 2]]), np.zeros(1, np.int32))
    swung = lambda X, t: X + curve(t) + height(t)
    last = lambda X, t: X + math.sin(t) * helpers.REACH
    motions = (swung, push, functools.partial(scaled, by=0.7), rig, rig.pose, last)
    supports = tuple(pdvol.Support(where, motion=motion) for motion in motions)
    return pdvol.Scene((pdvol.Body((shape,), pdvol.NeoHookean(young)),), dt=0.01, steps=1, supports=supports)
"""
EDITS = {
    "a constant": ("shot.py", "SPEED = 0.1", "SPEED = 0.9"),
    "a set": ("shot.py", '"top"', '"bottom"'),
    "an array": ("shot.py", "TABLE = np.array([0.0, 1.0])", "TABLE = np.array([0.0, 2.0])"),
    "an argument of a partial": ("shot.py", "by=0.7", "by=0.8"),
    "a default": ("shot.py", "far=1.0", "far=2.0"),
    "an attribute": ("shot.py", "rig = Rig(0.2)", "rig = Rig(0.3)"),
    "a dictionary in an attribute": ("shot.py", '"start": 0.5', '"start": 0.6'),
    "a method": ("shot.py", "return X + self.gain\n", "return X - self.gain\n"),
    "what a method reads": ("shot.py", "WEIGHT = 1.5", "WEIGHT = 2.5"),
    "what a helper reads": ("helpers.py", "REACH = 0.5", "REACH = 0.6"),
    "an object of a library": ("shot.py", "[0.0, 0.5, 1.0]", "[0.0, 0.5, 2.0]"),
    "what a cached function reads": ("shot.py", "HIGH = 0.4", "HIGH = 0.5"),
    "a module of a helper": ("settings.py", "PACE = 2.0", "PACE = 3.0"),
}


PROGRAM = """
import json, multiprocessing, sys
from pathlib import Path
import pdvol, scipy.interpolate
from pdvol.runs.scene_file import load_shot

def described(path):
    return load_shot(Path(path), {}).description()

with multiprocessing.get_context("fork").Pool(1, maxtasksperchild=1) as pool:
    print(json.dumps(pool.map(described, sys.argv[1:], chunksize=1)))
"""
"""The descriptions of scene files, each in a process of its own, a copy of one that has loaded the libraries."""


def descriptions(*folders, seed):
    """Those of the scene files in folders, each in a process of its own, all with one seed of hashes."""
    environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONDONTWRITEBYTECODE": "1"}
    words = [sys.executable, "-c", PROGRAM, *(folder / "shot.py" for folder in folders)]
    return json.loads(subprocess.run(words, env=environment, capture_output=True, text=True, check=True).stdout)


def written(folder, edited="", old="", new=""):
    """The folder with the scene file and its modules, one of which is edited."""
    folder.mkdir()
    for name, text in (("shot.py", SCENE), ("helpers.py", HELPERS), ("settings.py", SETTINGS)):
        assert name != edited or text.count(old) == 1
        (folder / name).write_text(text.replace(old, new) if name == edited else text)
    return folder


@pytest.fixture(scope="module")
def unchanged(tmp_path_factory):
    return written(tmp_path_factory.mktemp("scenes") / "unchanged")


@pytest.fixture(scope="module")
def described(unchanged):
    """The description of the scene, and that after each edit."""
    folders = [written(unchanged.with_name(edit), *EDITS[edit]) for edit in EDITS]
    return dict(zip(("unchanged", *EDITS), descriptions(unchanged, *folders, seed="0"), strict=True))


def test_an_unchanged_scene_is_the_same_in_another_process(unchanged, described):
    first, (second,) = described["unchanged"], descriptions(unchanged, seed="1")
    assert first == second and differences(first, second) == [] and not_compared(first) == []


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_of_what_a_function_reads_is_another_scene(described, edit):
    lines = differences(described["unchanged"], described[edit])
    assert lines and all(line.startswith("scene.supports[") for line in lines)
    if edit == "a constant":
        assert lines == ["scene.supports[1].motion.reads.SPEED: 0.1 -> 0.9"]


def test_runs_stored_before_functions_had_reads_are_the_same_scene(described):
    now = described["unchanged"]
    then = json.loads(json.dumps(now))
    for support in then["supports"]:
        support["motion"].pop("reads", None)
    assert differences(then, now) == []


def test_what_functions_change_while_they_are_called_is_not_compared(tmp_path):
    (tmp_path / "shot.py").write_text(
        SCENE.replace("import helpers\nfrom helpers import eased\n", "")
        .replace("def push(X, t, far=1.0):\n", "SEEN = {}\n\ndef push(X, t, far=1.0):\n    SEEN[t] = X\n")
        .replace(" * helpers.REACH", "")
        .replace("eased(t)", "t")
    )
    shot = load_shot(tmp_path / "shot.py", {})
    before = shot.description()
    shot.scene.supports[1].motion(np.zeros((1, 2)), 0.5)
    assert shot.description() == before == load_shot(tmp_path / "shot.py", {}).description()


def test_what_cannot_be_compared_is_named():
    class Slots:
        __slots__ = ("gain",)

        def __init__(self, gain):
            self.gain = gain

        def __call__(self, X, t):
            return X * self.gain

    held = [describe(pdvol.Support(lambda X: X[:, 0] > 0, motion=Slots(gain))) for gain in (1.0, 2.0)]
    assert not_compared(held) == [] and held[0] != held[1]
    opaque = memoryview(b"abc")
    assert not_compared(describe({"a": [opaque]})) == ["scene.a[0] (memoryview)"]
