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
    extension = tomllib.loads((ROOT / "blender" / "blender_manifest.toml").read_text())
    recipe = re.search(r'^  version: "(.+)"$', (ROOT / "packaging" / "recipe.yaml").read_text(), re.MULTILINE)
    assert project["version"] == pdvol.__version__ == cited[1] == changed[1] == extension["version"] == recipe[1]


CONDA_NAMES = {"gmsh": "python-gmsh", "lazy-loader": "lazy_loader", "libigl": "igl", "matplotlib": "matplotlib-base"}
"""Names that differ on conda-forge."""


def test_the_conda_recipe_needs_what_the_wheel_needs():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    recipe = (ROOT / "packaging" / "recipe.yaml").read_text()
    needed = {}
    for line in project["dependencies"]:
        name, bounds = re.fullmatch(r"([\w-]+)(.*)", line).groups()
        needed[CONDA_NAMES.get(name, name)] = bounds
    listed = dict(
        re.findall(r"^    - ([\w-]+) (\S+)$", recipe.split("\n  run:\n")[1].split("\ntests:")[0], re.MULTILINE)
    )
    assert {name: listed.get(name) for name in needed} == needed
    assert set(listed) - set(needed) == {"fenics-dolfinx"}
    assert project["requires-python"] == ">=" + re.search(r'python_min: "(.+)"', recipe)[1]


def test_one_licence():
    """pyproject.toml states it for all files, as an SPDX expression; its texts are in wheel and source archive."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    cited = re.search(r"^license: (.+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert project["license"] == cited[1] == "LGPL-3.0-or-later"
    assert cited[1] in (ROOT / "README.md").read_text() and cited[1] in (ROOT / "CONTRIBUTING.md").read_text()
    extension = tomllib.loads((ROOT / "blender" / "blender_manifest.toml").read_text())
    assert extension["license"] == [f"SPDX:{cited[1]}"]
    assert project["license-files"] == ["COPYING", "COPYING.LESSER"]
    assert "GNU LESSER GENERAL PUBLIC LICENSE" in (ROOT / "COPYING.LESSER").read_text()
    assert "GNU GENERAL PUBLIC LICENSE" in (ROOT / "COPYING").read_text()


def test_copied_code_has_its_licence_beside_it():
    copied = [file for file in (ROOT / "pdvol").rglob("vendor/**/*") if file.is_file()]
    assert copied and all((file.parent / "LICENSE").is_file() for file in copied)


def test_nothing_installs_pdvol_by_a_name_that_anyone_could_register():
    """Until it is registered: pip gets a wheel, a checkout, or an address with its digest."""
    files = [*ROOT.iterdir(), *(file for top in TOPS for file in (ROOT / top).rglob("*"))]
    texts = [file for file in files if file.is_file() and file.suffix in TEXTS and file != Path(__file__)]
    texts.remove(ROOT / "CHANGELOG.md")  # what former releases said
    assert len(texts) > 300
    for file in texts:
        found = BY_NAME.search(file.read_text(encoding="utf-8"))
        assert found is None, f"{file}: {found[0]}"


TEXTS = {".py", ".md", ".toml", ".yaml", ".yml", ".ipynb", ".sh", ".cff", ".rst", ".html", ".txt", ""}
TOPS = ("benchmarks", "blender", "demos", "docs", "forms", "joss", "meshes", "packaging", "pdvol", "tests")
BY_NAME = re.compile(r"""pip3?\W+install\b[\w \t'",=<>[\]-]*?(?<![\w./@-])pdvol(?![\w/.@-])""")
