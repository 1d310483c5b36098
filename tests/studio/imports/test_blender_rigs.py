"""Point caches from Blender's own exports, against the points that Blender has. PDVOL_BLENDER_PYTHON names a Python
that has the package bpy (5.0.1 has a wheel for CPython 3.11); without it these tests are skipped.
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from commands import SAFETY
from pdvol import PointCache
from pdvol.meshing.point_caches import read_frames

BLENDER = os.environ.get("PDVOL_BLENDER_PYTHON", "")
PROGRAM = Path(__file__).resolve().parents[2] / "helpers" / "rig_in_blender.py"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not BLENDER, reason="PDVOL_BLENDER_PYTHON names no Python that has bpy"),
]
FLOAT32 = 2e-6  # m: positions of a few metres
Z_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # from Alembic's y upward


@pytest.fixture(scope="module")
def rig(tmp_path_factory) -> tuple[Path, dict]:
    """The folder of the exports, and Blender's points by name of the mesh and frame."""
    folder = tmp_path_factory.mktemp("rig")
    ended = subprocess.run([BLENDER, str(PROGRAM), str(folder)], capture_output=True, text=True, timeout=SAFETY)
    assert ended.returncode == 0, ended.stderr
    (line,) = [line for line in ended.stdout.splitlines() if line.startswith("FOUND")]
    return folder, json.loads(line.removeprefix("FOUND"))


@pytest.mark.parametrize(
    "file, prim, name",
    [
        ("rig.abc", "/rig/hand/Cube", "hand"),
        ("rig.abc", "/bones/finger/Cylinder", "finger"),
        ("rig.usdc", "/root/rig/hand/Cube", "hand"),  # blend shapes, below a prim that moves
        ("rig.usdc", "/root/bones/finger/Cylinder", "finger"),  # a skeleton
    ],
)
def test_an_export_of_blender_has_blenders_points(rig, file, prim, name):
    pytest.importorskip("pxr" if file.endswith("usdc") else "alembic3d", reason="an optional extra")
    folder, points = rig
    expected = np.array(points[name])
    assert abs(expected[-1] - expected[0]).max() > 0.5, "it moves"
    frames = read_frames(PointCache(folder / file, prim=prim))
    assert frames.times[-1] == pytest.approx((len(expected) - 1) / 24)
    rows = np.arange(expected.shape[1])
    for number, there in enumerate(expected):
        found = frames.at(number / 24, rows) @ (Z_UP if file.endswith("abc") else np.eye(3))
        np.testing.assert_allclose(found, there, atol=FLOAT32)
