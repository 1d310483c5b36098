"""The extension in Blender itself, without a window. PDVOL_BLENDER_PYTHON names a Python that has the package bpy;
without it these tests are skipped.
"""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from commands import SAFETY

BLENDER = os.environ.get("PDVOL_BLENDER_PYTHON", "")
ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "tests" / "helpers" / "in_extension.py"
SCENARIOS = [
    node.name
    for node in ast.parse(PROGRAM.read_text()).body
    if isinstance(node, ast.FunctionDef) and [a.arg for a in node.args.args] == ["folder"]
]
"""Functions of the program that take a folder alone."""


def test_there_are_as_many_scenarios_as_were_promised():
    assert len(SCENARIOS) >= 20


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory):
    made = tmp_path_factory.mktemp("zip") / "pdvol.zip"
    subprocess.run([sys.executable, ROOT / "packaging" / "blender_zip.py", made], check=True, timeout=SAFETY)
    return made


@pytest.mark.skipif(not BLENDER, reason="PDVOL_BLENDER_PYTHON names no Python that has bpy")
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_in_blender(scenario, extension_zip, tmp_path):
    variables = {
        "PDVOL_COMMAND": f"{sys.executable} -m pdvol",
        "PDVOL_ZIP": str(extension_zip),
        "BLENDER_USER_RESOURCES": str(tmp_path / "user"),
        "XDG_STATE_HOME": str(tmp_path / "state"),
    }
    (tmp_path / "files").mkdir()
    ended = subprocess.run(
        [BLENDER, str(PROGRAM), scenario, str(tmp_path / "files")],
        capture_output=True,
        text=True,
        timeout=2 * SAFETY,
        env={**os.environ, **variables},
    )
    assert ended.returncode == 0, f"{ended.stdout[-2000:]}\n{ended.stderr[-3000:]}"
    assert f"{scenario} holds in Blender" in ended.stdout
