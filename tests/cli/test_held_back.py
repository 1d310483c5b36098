"""Runs in which contact holds scripted motions back. The delay is reported, obstacles are stored where they really are,
and a resumed run gives the same states. A motion that fails ends the run with a one-line error.
"""

import numpy as np
import pytest

from cli_scenes import SQUARE, pdvol, write
from pdvol import open_run
from pdvol.measure.verify import verify_run
from pdvol.runs.stored_fields import SceneFields, stored_scene
from runs import assert_same_runs

PRESS = (
    SQUARE
    + """

def scene(steps=10, fail=1e9):
    sink = lambda X, t: X - (0.0, 8.0 * t) if t < fail else X * np.nan
    corners = np.array([(0.1, 1.4), (0.9, 1.4), (0.9, 1.6), (0.1, 1.6)])
    ram = Rigid(Outline(corners), motion=pdvol.Path((0.0, 1.0), ((0.0, 0.0), (0.0, -8.0))), name="ram")
    return Scene(
        bodies=(Body((square(2), square(3)), NeoHookean(2e4), name="square"),),
        supports=(Support(lambda X: X[:, 1] < 1e-9),),
        obstacles=(ram, Plane((0.0, 1.2), (0.0, -1.0), motion=sink, name="plate")),
        contact=(Barrier(dhat=0.02),),
        dt=0.02,
        steps=steps,
    )
"""
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A scene whose plate and ram go through a block that is held at its bottom, and a run of it."""
    folder = tmp_path_factory.mktemp("press")
    write(folder / "press.py", PRESS)
    assert pdvol("run", folder / "press.py", "--out", folder / "whole") == 0
    return folder


def test_nothing_is_crossed_at_the_real_positions(folder, capfd):
    run = open_run(folder / "whole")
    assert verify_run(folder / "whole") == []
    for level in run.levels:
        last = level.log[-1]
        assert last["behind"] > 0.0 and 0.0 <= last["reached"] < 1.0 and last["remedies"]["substeps"] > 0
        ram, plate = level.placed(run.obstacles, last["step"])
        # The ram, which is higher, follows until it meets the block as well.
        assert last["behind"] == last["late"]["obstacle 1"] > last["late"]["obstacle 0"] > 0.0
        falls = [8.0 * (last["time"] - last["late"][f"obstacle {i}"]) for i in (0, 1)]
        np.testing.assert_allclose(ram.vertices(0)[0], (0.1, 1.4 - falls[0]), atol=1e-12)
        np.testing.assert_allclose(plate.plane(0)[0], (0.0, 1.2 - falls[1]), atol=1e-12)
        np.testing.assert_allclose(level.placed(run.obstacles, 1)[1].plane(1)[0], (0.0, 1.2 - 8.0 * 0.02), atol=1e-12)
    # Where the script has the plate by now it would have gone through the block.
    assert run.obstacles[1].plane(10)[0][1] < 0.0
    assert pdvol("info", folder / "whole") == 0
    printed = [line for line in capfd.readouterr().out.splitlines() if "held scripted motions back" in line]
    assert [line.split(":")[0] for line in printed] == ["level 0", "level 1"]
    assert all("s behind at the end" in line and "first in step" in line for line in printed)


def test_forces_use_the_real_positions_of_obstacles(folder):
    """The plate would have passed through the block at the position in its script."""
    run = open_run(folder / "whole")
    level = run.levels[1]
    last = level.log[-1]
    assert level.lateness(last["step"])[0] == last["behind"] > 0.0 and level.lateness(1) == (0.0, {})
    scene, obstacles = stored_scene(run)
    force = SceneFields(scene, run, 1, obstacles).contact_force(last["step"])
    assert np.isfinite(force).all()
    pressed = level.positions(last["step"])[:, 1] > 1e-6
    assert force[pressed, 1].min() < -1.0 and force[pressed, 1].max() <= 0.0


def test_a_resumed_run_gives_the_same_states(folder):
    assert pdvol("run", folder / "press.py", "--out", folder / "parts", "--steps", 9) == 0
    assert open_run(folder / "parts").levels[0].log[-1]["behind"] > 0.0
    assert pdvol("run", folder / "press.py", "--out", folder / "parts", "--resume") == 0
    assert_same_runs(folder / "parts", folder / "whole")


def test_a_motion_that_fails_ends_in_one_line(folder, capfd):
    """Between the ends of steps a motion is only evaluated when contact cuts it into parts. If it fails there, the run
    keeps the completed steps. A motion that fails at the end of a step is found before the run starts.
    """
    write(folder / "parts.py", PRESS.replace("if t < fail", "if abs(t / 0.02 - round(t / 0.02)) < 1e-9"))
    capfd.readouterr()
    assert pdvol("run", folder / "parts.py", "--levels", "0", "--out", folder / "cut") == 2
    err = capfd.readouterr().err.splitlines()
    assert err[-1].startswith("pdvol: plane 'plate': its motion gives NaN or infinity at t = 0.0")
    run = open_run(folder / "cut")
    assert run.info["state"] == "failed" and "plate" in run.levels[0].info["reason"] and run.levels[0].steps >= 2
    assert pdvol("run", folder / "press.py", "--set", "fail=0.05", "--out", folder / "nan") == 2
    assert capfd.readouterr().err == "pdvol: plane 'plate': its motion gives NaN or infinity at t = 0.06 s\n"
    assert not (folder / "nan").exists()
