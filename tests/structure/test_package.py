"""What is installed: pyproject.toml lists every folder of Python files. C sources and headers of all of them are
installed by one rule. What a release states in several files is the same in all of them.
"""

import re
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pdvol

ROOT = Path(__file__).resolve().parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT, SETUPTOOLS = PYPROJECT["project"], PYPROJECT["tool"]["setuptools"]
CONDA_NAMES = {"gmsh": "python-gmsh", "lazy-loader": "lazy_loader", "libigl": "igl", "matplotlib": "matplotlib-base"}
"""Names that differ on conda-forge."""
TEXTS = {".py", ".md", ".toml", ".yaml", ".yml", ".ipynb", ".sh", ".cff", ".rst", ".html", ".txt", ""}
TOPS = ("benchmarks", "blender", "demos", "docs", "forms", "joss", "meshes", "packaging", "pdvol", "tests")
BY_NAME = re.compile(r"""pip3?\W+install\b[\w \t'",=<>[\]-]*?(?<![\w./@-])pdvol(?![\w/.@-])""")


def package_of(folder: Path) -> str:
    """`pdvol.solve.linear` of a folder below the root; forms/ and meshes/ are installed below pdvol."""
    parts = folder.relative_to(ROOT).parts
    return ".".join(parts if parts[0] == "pdvol" else ("pdvol", *parts))


def test_every_folder_of_python_files_is_installed():
    files = [file for top in ("pdvol", "forms", "meshes") for file in (ROOT / top).rglob("*.py")]
    folders = {file.parent for file in files}
    assert all((folder / "__init__.py").exists() for folder in folders)
    assert sorted(SETUPTOOLS["packages"]) == sorted(map(package_of, folders))


def test_every_other_file_is_installed():
    tops = [ROOT / top for top in ("pdvol", "forms", "meshes")]
    files = [file for top in tops for file in top.rglob("*") if file.is_file() and "__pycache__" not in file.parts]
    data = {file for file in files if file.suffix != ".py"}
    assert {file.suffix for file in data} >= {".c", ".h"}
    rules = SETUPTOOLS["package-data"]
    for folder in {file.parent for file in files if file.name == "__init__.py"}:
        # A package's patterns name files in it, and in folders below that hold no modules.
        for pattern in (*rules["*"], *rules.get(package_of(folder), ())):
            data -= (found := set(folder.glob(pattern)))
            assert found or pattern in rules["*"], f"{folder}: no file {pattern}"
    assert sorted(str(file.relative_to(ROOT)) for file in data) == []


def test_the_source_archive_has_every_folder():
    """MANIFEST.in names the folders that setuptools does not take by itself. Generated ones are those of .gitignore."""
    named = set(re.findall(r"^graft (\S+)$", (ROOT / "MANIFEST.in").read_text(), re.MULTILINE))
    generated = [line.strip("/") for line in (ROOT / ".gitignore").read_text().split()]
    folders = {path.name for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith(".")}
    kept = {name for name in folders if not any(fnmatch(name, pattern) for pattern in generated)}
    assert kept == named - {".ci"} | {"pdvol", "forms", "meshes"}


def test_one_version_and_one_licence():
    """The licence's texts are in wheel and source archive, and that of copied code lies beside it."""
    stated = lambda name, file: re.search(rf'^ *{name}: "?([^"\n]+)"?$', (ROOT / file).read_text(), re.MULTILINE)[1]
    changed = re.search(r"^## (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[1]
    extension = tomllib.loads((ROOT / "blender" / "blender_manifest.toml").read_text())
    cited, recipe = stated("version", "CITATION.cff"), stated("version", "packaging/recipe.yaml")
    assert PROJECT["version"] == pdvol.__version__ == cited == changed == extension["version"] == recipe
    licence = PROJECT["license"]
    assert licence == stated("license", "CITATION.cff") and extension["license"] == [f"SPDX:{licence}"]
    assert PROJECT["license-files"] == ["COPYING", "COPYING.LESSER"]
    copied = [file for file in (ROOT / "pdvol").rglob("vendor/**/*") if file.is_file()]
    assert copied and all((file.parent / "LICENSE").is_file() for file in copied)


def test_the_conda_recipe_needs_what_the_wheel_needs():
    recipe = (ROOT / "packaging" / "recipe.yaml").read_text()
    pairs = [re.fullmatch(r"([\w-]+)(.*)", line).groups() for line in PROJECT["dependencies"]]
    needed = {CONDA_NAMES.get(name, name): bounds for name, bounds in pairs}
    runs = recipe.split("\n  run:\n")[1].split("\ntests:")[0]
    listed = dict(re.findall(r"^    - ([\w-]+) (\S+)$", runs, re.MULTILINE))
    assert {name: listed.get(name) for name in needed} == needed
    assert set(listed) - set(needed) == {"fenics-dolfinx"}
    assert PROJECT["requires-python"] == ">=" + re.search(r'python_min: "(.+)"', recipe)[1]


def test_nothing_installs_pdvol_by_a_name_that_anyone_could_register():
    """Until it is registered: pip gets a wheel, a checkout, or an address with its digest."""
    files = [*ROOT.iterdir(), *(file for top in TOPS for file in (ROOT / top).rglob("*"))]
    texts = [file for file in files if file.is_file() and file.suffix in TEXTS and file != Path(__file__)]
    texts.remove(ROOT / "CHANGELOG.md")  # what former releases said
    found = [match[0] for file in texts if (match := BY_NAME.search(file.read_text(encoding="utf-8")))]
    assert len(texts) > 300 and found == []
