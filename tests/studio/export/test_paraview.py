"""Exports as ParaView opens them. PDVOL_PVPYTHON is the command that starts ParaView's pvpython ("xvfb-run -a pvpython"
without a display); without it these tests are skipped. ParaView 5.11.0 and 5.13.2 have been tried.
"""

import json
import os
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import runs
from commands import SAFETY
from pdvol.store.reader import open_run
from pdvol.studio.export.exports import export_run
from pdvol.studio.shown import PALETTE

PVPYTHON = shlex.split(os.environ.get("PDVOL_PVPYTHON", ""))
PROGRAM = Path(__file__).resolve().parents[2] / "helpers" / "in_paraview.py"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not PVPYTHON, reason="PDVOL_PVPYTHON names no command that starts pvpython"),
]
STEPS = 10
FLOAT32 = 1e-6  # m: ParaView's warped points, of a few metres


@pytest.mark.parametrize("dim", [2, 3])
def test_the_script_shows_all_bodies_at_all_times(dim, tmp_path):
    path = runs.stored_run(tmp_path / "run", dim, (60, 200), STEPS)
    written, _ = export_run(path, "xdmf", tmp_path / "out")
    picture = tmp_path / "picture.png"
    ended = subprocess.run(
        [*PVPYTHON, str(PROGRAM), str(written[-1]), str(picture)], capture_output=True, text=True, timeout=SAFETY
    )
    assert ended.returncode == 0, ended.stderr
    (line,) = [line for line in ended.stdout.splitlines() if line.startswith("FOUND")]
    found = json.loads(line.removeprefix("FOUND"))
    run = open_run(path)
    np.testing.assert_allclose(found["times"], np.arange(STEPS + 1) * run.dt, atol=1e-12)
    assert found["legend"] == ["0", "left", "1", "right"] and set(found["levels"]) == {"0", "1"}
    for level in run.levels:
        seen = found["levels"][str(level.index)]
        assert seen["bodies"] == level.bodies.tolist() and {"displacement", "velocity"} <= set(seen["points"])
        for step, state in enumerate(seen["states"]):
            np.testing.assert_allclose(np.array(state)[:, :dim], level.positions(step), atol=FLOAT32)
    pixels = np.asarray(Image.open(picture).convert("RGB"), dtype=float)
    for code in PALETTE[:2]:  # some pixels have a body's hue, whatever the light
        colour = np.array([int(code[i : i + 2], 16) for i in (1, 3, 5)], dtype=float)
        angle = (pixels @ colour) / (np.linalg.norm(pixels, axis=2) * np.linalg.norm(colour) + 1e-9)
        assert (angle > np.cos(np.radians(4))).mean() > 0.01
