"""What is installed: pyproject.toml lists every folder of Python files. C sources and headers of all of them are
installed by one rule.
"""

import re
import tomllib
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SETUPTOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]


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
            data -= set(folder.glob(pattern))
    assert sorted(str(file.relative_to(ROOT)) for file in data) == []


def test_package_data_names_files_that_exist():
    for package, patterns in SETUPTOOLS["package-data"].items():
        folder = ROOT / ("pdvol" if package == "*" else Path(*package.split(".")))
        for pattern in patterns:
            found = folder.rglob(pattern) if package == "*" else folder.glob(pattern)
            assert list(found), f"{package}: no file {pattern}"


def test_the_source_archive_has_every_folder():
    """MANIFEST.in names the folders that setuptools does not take by itself. Generated ones are those of .gitignore."""
    named = set(re.findall(r"^graft (\S+)$", (ROOT / "MANIFEST.in").read_text(), re.MULTILINE))
    generated = [line.strip("/") for line in (ROOT / ".gitignore").read_text().split()]
    folders = {path.name for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith(".")}
    kept = {name for name in folders if not any(fnmatch(name, pattern) for pattern in generated)}
    assert kept == named - {".ci"} | {"pdvol", "forms", "meshes"}
