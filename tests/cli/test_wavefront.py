"""Levels side by side: the same numbers as one after the other, and what happens when one cannot go on."""

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from cli_scenes import pdvol, pdvol_on_ranks
from commands import SAFETY
from on_ranks import results_on
from pdvol import open_run

SCENE = """
import sys
import time
from pathlib import Path
import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Plane, Scene, Solver
from pdvol.meshes import disc

def gravity(t):
    # In the process of level 0 of a wavefront: waits until level 1 runs beside it.
    program, *words = sys.argv
    marches = Path(program).name == "level_processes.py" and words[1] == "0"
    while marches and t > 0.05 and pdvol.open_run(words[0]).levels[1].steps < 2:
        time.sleep(0.01)
    return (0.0, -9.81)

def scene(tolerance=1e-3, iterations=200, halvings=6):
    ball = Body(disc(0.5), NeoHookean(5e4), vertices=(30, 60, 120), velocity=(0.5, -3.0))
    solver = Solver(tolerance=tolerance, max_iterations=iterations, max_halvings=halvings)
    return Scene(bodies=(ball,), dt=0.01, steps=14, loads=(Gravity(gravity),),
                 obstacles=(Plane((0.0, -0.55), (0.0, 1.0)),), contact=(Barrier(), Friction(0.5)), solver=solver)
"""
KEYED = """
from pdvol import Barrier, Body, Flow, Friction, Gravity, Keyed, Muscle, NeoHookean, Placement, Plane, Scene, meshes

def scene():
    soft = NeoHookean(Keyed((0.0, 0.1), (1e5, 6e4)), 0.3, 1000.0)
    block = Body(meshes.rectangle(0.4, 0.2), soft, (30, 90), placement=Placement(translate=(0.0, 0.104)))
    loads = (Gravity(Keyed((0.0, 0.1), ((0.0, 0.0), (5.0, -9.81)))), Flow(Keyed((0.0, 0.1), ((0.0, 0.0), (3.0, 0.0)))))
    return Scene(bodies=(block,), dt=0.01, steps=12, loads=loads, contact=(Barrier(), Friction(0.2)),
                 muscles=(Muscle("body", (1.0, 0.0), 2e4, Keyed((0.0, 0.1), (0.0, 1.0))),),
                 obstacles=(Plane((0.0, 0.0), (0.0, 1.0)),))
"""
ATTACHED = """
import pdvol
from pdvol import Attachment, Barrier, Body, Gravity, NeoHookean, Placement, Plane, Scene, Support, meshes

def scene(strength=900.0):
    soft = NeoHookean(1e5, 0.3, 1000.0)
    held = Body(meshes.rectangle(0.4, 0.1), soft, (30, 90), name="held", placement=Placement(translate=(0.0, 0.154)))
    hung = Body(meshes.rectangle(0.4, 0.2), soft, (30, 90), name="hung", velocity=lambda X: -2.0 * X[:, :1] * (0, 1))
    glue = Attachment("hung", "held", lambda X: X[:, 1] > 0.099, stiffness=5e5, breaking=strength)
    return Scene(bodies=(held, hung), dt=0.01, steps=12, loads=(Gravity((0.0, -9.81)),), attachments=(glue,),
                 supports=(Support(lambda X: X[:, 1] > 0.2, body="held"),), contact=(Barrier(),))
"""
DYING = """
import os, signal, sys

stored = []

def die(event, arguments):
    if event == "open" and str(arguments[0]).endswith("levels/1/states.bin") and arguments[2] & os.O_WRONLY:
        if len(stored) == 5:
            os.kill(os.getpid(), signal.SIGKILL)
        stored.append(event)

sys.addaudithook(die)
import pdvol
pdvol.main()
"""
"""pdvol's command in a process that is killed just before it stores step 5 of level 1."""
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1"}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    file = tmp_path_factory.mktemp("scenes") / "bounce.py"
    file.write_text(SCENE)
    return file


@pytest.fixture(scope="module")
def one_after_the_other(scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "sequential"
    assert pdvol("run", scene, "--out", out) == 0
    return open_run(out)


def assert_same(run, other):
    assert run.info["state"] == other.info["state"] == "done"
    for mine, theirs in zip(run.levels, other.levels, strict=True):
        assert mine.steps == theirs.steps == 15
        for step in range(mine.steps):
            np.testing.assert_array_equal(mine.positions(step), theirs.positions(step))
        assert sorted(r["step"] for r in mine.log) == list(range(1, 15))
        assert (mine.folder.parents[1] / f"level_{mine.index}.xdmf").is_file()


def test_numbers_are_those_of_one_after_the_other(scene, one_after_the_other, tmp_path):
    assert pdvol("run", scene, "--out", tmp_path / "run", "--wavefront") == 0
    assert_same(open_run(tmp_path / "run"), one_after_the_other)
    levels = [json.loads(line)["level"] for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    assert levels != sorted(levels), "no level ran beside another"


def test_a_killed_wavefront_goes_on_where_it_was(scene, one_after_the_other, tmp_path):
    out = tmp_path / "run"
    words = ["run", str(scene), "--out", str(out), "--wavefront"]
    # Standard error ends when the last of the processes has ended, those of the levels included.
    killed = subprocess.run(
        [sys.executable, "-c", DYING, *words], env=ENVIRONMENT, stderr=subprocess.PIPE, timeout=SAFETY
    )
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    assert open_run(out).levels[1].steps == 5
    assert pdvol("run", scene, "--out", out, "--wavefront", "--resume") == 0
    assert_same(open_run(out), one_after_the_other)


def test_a_level_that_cannot_go_on_ends_the_finer_ones(scene, tmp_path, capfd):
    out = tmp_path / "run"
    words = ["--set", "iterations=1", "--set", "halvings=0", "--set", "tolerance=1e-12"]
    assert pdvol("run", scene, "--out", out, "--wavefront", *words) == 1
    assert capfd.readouterr().err.strip().splitlines()[-1].startswith("pdvol: level 0, step 1:")
    assert open_run(out).info["state"] == "failed"


@pytest.mark.mpi
def test_ranks_and_a_wavefront_do_not_go_together(scene, tmp_path):
    (done,) = results_on((2,), pdvol_on_ranks, "run", scene, "--out", tmp_path / "run", "--wavefront")
    assert done["code"] == 2
    assert "--wavefront" in str(done["said"])
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("text", [KEYED, ATTACHED], ids=["keyed", "attached"])
def test_terms_act_alike_side_by_side(text, tmp_path):
    """To the last bit, on both levels, which differ from each other and from rest; what has broken is in the log."""
    scene = tmp_path / "scene.py"
    scene.write_text(text)
    for out, more in (("one_after_the_other", []), ("side_by_side", ["--wavefront"])):
        assert pdvol("run", scene, "--no-xdmf", "--out", tmp_path / out, *more) == 0
    both = [open_run(tmp_path / out).levels for out in ("one_after_the_other", "side_by_side")]
    for one, other in zip(*both, strict=True):
        assert one.steps == other.steps == 13
        assert np.abs(one.positions(12) - one.rest).max() > 5e-3
        for step in range(one.steps):
            np.testing.assert_array_equal(one.positions(step), other.positions(step))
        broken, same = (
            [record["terms"].get("attachment", {}).get("broken", []) for record in x.log] for x in (one, other)
        )
        assert broken == same and broken[0] == []
        assert text == KEYED or len({len(found) for found in broken}) >= 3, "springs break one after the other"
