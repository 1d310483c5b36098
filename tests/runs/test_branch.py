"""Runs that begin with the stored states of another one."""

import numpy as np
import pytest

import runs
from cli_scenes import FALL, SQUARE, pdvol, write
from pdvol.store.reader import open_run

STEPS, AT = 10, 4


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("branch")
    write(made / "fall.py", FALL)
    assert run(made, "whole") == 0
    return made


def run(folder, name, *words):
    return pdvol("run", folder / "fall.py", "--out", folder / name, "--no-picture", "--no-xdmf", *words)


def branch(folder, name, *words, source="whole"):
    return run(folder, name, "--branch", folder / source, "--at", AT, *words)


def states(folder, name, level):
    stored = open_run(folder / name).levels[level]
    return [stored.positions(step) for step in range(stored.steps)]


def test_with_others_it_differs_from_that_step_on_and_can_be_resumed(folder):
    assert branch(folder, "softer", "--set", "young=8e3") == 0
    assert run(folder, "straight", "--set", "young=8e3") == 0
    for level in (0, 1):
        changed = states(folder, "softer", level)
        same = [np.array_equal(a, b) for a, b in zip(changed, states(folder, "whole", level), strict=True)]
        assert same == [step <= AT for step in range(STEPS + 1)]
        assert not np.array_equal(changed[-1], states(folder, "straight", level)[-1])
    runs.keep_states(folder / "softer" / "levels" / "0", 6)
    whole = states(folder, "softer", 1)
    assert run(folder, "softer", "--set", "young=8e3", "--resume") == 0
    np.testing.assert_array_equal(states(folder, "softer", 1), whole)
    assert pdvol("verify", folder / "softer") == 0


def test_a_level_that_has_not_reached_the_step_is_not_refined(folder, capsys):
    assert run(folder, "preview", "--levels", "0") == 0
    assert branch(folder, "deep", source="preview") == 2
    assert "level 1" in capsys.readouterr().err
    assert branch(folder, "flat", "--levels", "0", "--set", "young=8e3", source="preview") == 0
    assert pdvol("refine", folder / "flat", "--to", 1, "--no-picture") == 2
    assert "has no level 1" in capsys.readouterr().err
    assert len(open_run(folder / "flat").levels) == 1


PRESSED = (
    SQUARE
    + """

def at(x, t, pushed, turn):
    \"\"\"Downward by 0.1 m/s; from t = 0.08 s on `pushed` times as fast. `turn` s earlier it is elsewhere.\"\"\"
    return x - np.array([0.0, 0.1 * t + 0.1 * (pushed - 1.0) * max(t - 0.08 + turn, 0.0)])


def scene(pushed=1.0, led=1.0, turn=0.0, wide=0.01, name="press", steps=10, sizes=(2, 4)):
    press = Outline([(-0.5, 1.005), (1.5, 1.005), (1.5, 1.2), (-0.5, 1.2)])
    return Scene(
        bodies=(Body(tuple(square(n) for n in sizes), NeoHookean(2e4), name="square"),),
        obstacles=(Rigid(press, name=name, motion=lambda x, t: at(x, t, pushed, turn)),),
        supports=(Support(lambda X: X[:, 1] < wide, motion=lambda x, t: at(x, t, led, turn)),),
        contact=(Barrier(), Friction(0.3)),
        dt=0.02,
        steps=steps,
    )
"""
)


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    made = tmp_path_factory.mktemp("pressed")
    write(made / "fall.py", PRESSED)
    assert run(made, "whole") == 0
    assert run(made, "preview", "--levels", "0") == 0
    return made


@pytest.mark.parametrize(("which", "word"), [("obstacle", "pushed=4"), ("support", "led=-1")])
def test_motions_may_differ_from_that_step_on(pressed, which, word):
    """Up to the step it is the old run, and from there on the run that has the other motion from the start."""
    assert branch(pressed, f"new_{which}", "--set", word) == 0
    assert run(pressed, f"straight_{which}", "--set", word) == 0
    for level in (0, 1):
        new, old, straight = (states(pressed, name, level) for name in (f"new_{which}", "whole", f"straight_{which}"))
        assert [np.array_equal(a, b) for a, b in zip(new, old, strict=True)] == [
            step <= AT for step in range(STEPS + 1)
        ]
        assert np.abs(new[-1] - old[-1]).max() > 1e-3
        assert np.abs(new[-1] - straight[-1]).max() < 1e-5
    assert open_run(pressed / f"new_{which}").info["branched"]["whole"]
    assert pdvol("verify", pressed / f"new_{which}") == 0


def test_a_preview_with_another_motion_can_be_refined(pressed):
    assert branch(pressed, "shown", "--levels", "0", "--set", "pushed=2", source="preview") == 0
    assert pdvol("refine", pressed / "shown", "--to", 1, "--no-picture", "--no-xdmf") == 0
    assert run(pressed, "straight", "--set", "pushed=2") == 0
    assert np.abs(states(pressed, "shown", 1)[-1] - states(pressed, "straight", 1)[-1]).max() < 1e-5


@pytest.mark.parametrize(
    "words, reason",
    [
        (["--set", "pushed=2", "--set", "turn=0.03"], "obstacle 'press' is elsewhere at step 3"),
        (["--set", "led=2", "--set", "turn=0.03"], "a support of all bodies, level 0 is elsewhere at step 3"),
        (["--set", "wide=0.3"], "another supports"),
        (["--set", "name=plate"], "with other obstacles (press -> plate)"),
    ],
)
def test_what_was_elsewhere_before_is_refused(pressed, capsys, words, reason):
    assert branch(pressed, "refused", *words) == 2
    said = capsys.readouterr().err
    assert reason in said and said.count("\n") == 1
    assert not (pressed / "refused").exists()
