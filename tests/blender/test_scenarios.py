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
PROGRAMS = [ROOT / "tests" / "helpers" / f"in_{name}.py" for name in ("extension", "interface")]
SCENARIOS = [
    (program, node.name)
    for program in PROGRAMS
    for node in ast.parse(program.read_text()).body
    if isinstance(node, ast.FunctionDef) and [a.arg for a in node.args.args] == ["folder"]
]
"""Functions of the programs that take a folder alone."""


def test_scenarios_are_found():
    assert {program for program, _ in SCENARIOS} == set(PROGRAMS)


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory):
    made = tmp_path_factory.mktemp("zip") / "pdvol.zip"
    subprocess.run([sys.executable, ROOT / "packaging" / "blender_zip.py", made], check=True, timeout=SAFETY)
    return made


@pytest.mark.skipif(not BLENDER, reason="PDVOL_BLENDER_PYTHON names no Python that has bpy")
@pytest.mark.parametrize(("program", "scenario"), SCENARIOS)
def test_in_blender(program, scenario, extension_zip, tmp_path):
    variables = {
        "PDVOL_COMMAND": f"{sys.executable} -m pdvol",
        "PDVOL_ZIP": str(extension_zip),
        "BLENDER_USER_RESOURCES": str(tmp_path / "user"),
        "XDG_STATE_HOME": str(tmp_path / "state"),
    }
    (tmp_path / "files").mkdir()
    ended = subprocess.run(
        [BLENDER, str(program), scenario, str(tmp_path / "files")],
        capture_output=True,
        text=True,
        timeout=2 * SAFETY,
        env={**os.environ, **variables},
    )
    assert ended.returncode == 0, f"{ended.stdout[-2000:]}\n{ended.stderr[-3000:]}"
    assert f"{scenario} holds in Blender" in ended.stdout
