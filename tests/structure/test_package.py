"""What is installed: pyproject.toml lists every folder of Python files, and every C source and header."""

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
    files = [file for file in (ROOT / "pdvol").rglob("*") if file.is_file() and "__pycache__" not in file.parts]
    data = [file for file in files if file.suffix != ".py"]
    assert {file.suffix for file in data} >= {".c", ".h"}
    for file in data:
        # A package's patterns name files in it, and in folders below that hold no modules.
        folder = next(parent for parent in file.parents if (parent / "__init__.py").exists())
        patterns = SETUPTOOLS["package-data"].get(package_of(folder), ())
        path = file.relative_to(folder).as_posix()
        assert any(fnmatch(path, pattern) for pattern in patterns), f"{file.relative_to(ROOT)} is not installed"


def test_package_data_names_files_that_exist():
    for package, patterns in SETUPTOOLS["package-data"].items():
        folder = ROOT / Path(*package.split("."))
        for pattern in patterns:
            assert list(folder.glob(pattern)), f"{package}: no file {pattern}"
