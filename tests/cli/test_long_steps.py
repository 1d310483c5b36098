"""A step that lasts says how far it is, wherever its level runs, and the display changes no state."""

import io
import re
from contextlib import redirect_stderr

import pytest

from cli_scenes import FALL, pdvol, states, write
from pdvol.integrate import long_step

EACH_ITERATION = """
from pdvol.integrate import long_step
long_step.SHOWN_AFTER = long_step.SHOWN_EVERY = 0.0
"""
LINE = re.compile(r"level (\d)  step ([123])/3  newton (\d+)  contacts \d+  (gap \S+  )?\d+\.\d\d s so far")
PLACES = {
    "one after the other": ["--ranks", 1],
    "side by side": ["--wavefront"],
    "on two ranks": ["--ranks", 2, "--levels", 0],
}


def stderr_of(folder, scene, *words) -> str:
    """What a run of three steps of two levels prints; it is stored in folder / "r"."""
    write(folder / "fall.py", scene)
    with redirect_stderr(io.StringIO()) as said:
        assert pdvol("run", folder / "fall.py", "--steps", 3, "-o", folder / "r", *words) == 0
    return said.getvalue()


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """The states of a run whose steps are short."""
    folder = tmp_path_factory.mktemp("short")
    said = stderr_of(folder, FALL)
    assert long_step.SHOWN_AFTER == 2.0 and "so far" not in said and said.count("  step ") == 6
    return [states(folder / "r", level) for level in (0, 1)]


@pytest.mark.parametrize("place", PLACES)
def test_a_long_step_says_how_far_it_is(place, short, tmp_path, monkeypatch):
    for name in ("SHOWN_AFTER", "SHOWN_EVERY"):  # which the scene file changes in this process, too
        monkeypatch.setattr(long_step, name, getattr(long_step, name))
    said = stderr_of(tmp_path, FALL + EACH_ITERATION, *PLACES[place])
    found = [LINE.fullmatch(line) for line in said.splitlines() if line.endswith("so far")]
    levels = "0" if "--levels" in PLACES[place] else "01"
    assert all(found) and {match.group(1, 2) for match in found} == {
        (level, step) for level in levels for step in "123"
    }
    assert all(int(match[3]) >= 1 for match in found)
    if place != "on two ranks":
        assert [states(tmp_path / "r", level) for level in (0, 1)] == short
