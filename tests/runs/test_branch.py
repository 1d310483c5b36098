"""Runs that begin with the stored states of another one."""

import json

import numpy as np
import pytest

from cli_scenes import FALL, pdvol, write
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


@pytest.mark.parametrize("words", [(), ("--set", "integrator=bdf2")], ids=["default", "bdf2"])
def test_with_the_same_settings_it_is_the_same_run(folder, words):
    whole = "of_bdf2" if words else "whole"
    if words:
        assert run(folder, whole, *words) == 0
    assert branch(folder, f"same_as_{whole}", *words, source=whole) == 0
    for level in (0, 1):
        for one, other in zip(states(folder, f"same_as_{whole}", level), states(folder, whole, level), strict=True):
            np.testing.assert_array_equal(one, other)
    assert open_run(folder / f"same_as_{whole}").info["branched"]["step"] == AT


def test_with_others_it_differs_from_that_step_on_and_can_be_resumed(folder):
    assert branch(folder, "softer", "--set", "young=8e3") == 0
    assert run(folder, "straight", "--set", "young=8e3") == 0
    for level in (0, 1):
        changed = states(folder, "softer", level)
        same = [np.array_equal(a, b) for a, b in zip(changed, states(folder, "whole", level), strict=True)]
        assert same == [step <= AT for step in range(STEPS + 1)]
        assert not np.array_equal(changed[-1], states(folder, "straight", level)[-1])
    for step in sorted((folder / "softer" / "levels" / "0").glob("00000[6-9].npy"), reverse=True):
        step.unlink()
    whole = states(folder, "softer", 1)
    assert run(folder, "softer", "--set", "young=8e3", "--resume") == 0
    for one, other in zip(states(folder, "softer", 1), whole, strict=True):
        np.testing.assert_array_equal(one, other)
    assert pdvol("verify", folder / "softer") == 0


@pytest.mark.parametrize(
    "words, reason",
    [
        (["--set", "height=0.5"], "another mesh or placement"),
        (["--set", "sizes=(3,5)"], "another mesh or placement"),
        (["--set", "dt=0.01"], "another dt"),
        (["--at", "11"], "no step 11"),
        (["--steps", "4"], "end of the shot"),
        (["--resume"], "leave out --resume"),
        (["--method", "direct"], "progressive"),
    ],
)
def test_what_does_not_fit_is_one_line_and_writes_nothing(folder, capsys, words, reason):
    assert branch(folder, "refused", *words) == 2
    said = capsys.readouterr().err
    assert reason in said and said.count("\n") == 1
    assert not (folder / "refused").exists()


def test_a_level_that_has_not_reached_the_step_is_not_refined(folder, capsys):
    assert run(folder, "preview", "--levels", "0") == 0
    assert branch(folder, "deep", source="preview") == 2
    assert "level 1" in capsys.readouterr().err
    assert branch(folder, "flat", "--levels", "0", "--set", "young=8e3", source="preview") == 0
    assert pdvol("refine", folder / "flat", "--to", 1, "--no-picture") == 2
    assert "has no level 1" in capsys.readouterr().err
    assert len(open_run(folder / "flat").levels) == 1


def test_the_records_belong_to_the_states(folder):
    branch(folder, "records", "--set", "young=8e3")
    records = [json.loads(line) for line in (folder / "records" / "log.jsonl").read_text().splitlines()]
    assert [r["step"] for r in records if r["level"] == 0] == list(range(1, STEPS + 1))
