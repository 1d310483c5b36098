"""What a release states in several files is the same in all of them."""

import re
import tomllib
from pathlib import Path

import pdvol

ROOT = Path(__file__).resolve().parents[2]


def test_one_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    changed = re.search(r"^## (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert project["version"] == pdvol.__version__ == cited[1] == changed[1]


def test_one_licence():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    cited = re.search(r"^license: (.+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert project["license"]["text"] == cited[1]
    assert cited[1] in (ROOT / "README.md").read_text()
    assert "GNU LESSER GENERAL PUBLIC LICENSE" in (ROOT / "COPYING.LESSER").read_text()
