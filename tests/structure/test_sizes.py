"""Ceilings of the repository: bytes of files and of the tree, lines of code, words of pages. What comes later makes its
own room.

The files are those of the last commit, as they are now; outside of a checkout these tests are skipped.
"""

import re
from functools import cache
from pathlib import Path

import pytest

from benchmarks.common.commits import MissingObject, Repository

ROOT = Path(__file__).resolve().parents[2]
MOST_BYTES = {"a file": 500_000, "the tree": 18_930_000}
LARGE = {"pdvol/studio/play/vendor/three-0.187.0/three.min.js"}
"""Files that may be larger: a library that players and live pages carry whole."""
CODE = (".py", ".c", ".h", ".js")
LINES = {
    # part: (folders or files, lines of code at most)
    "core": (("pdvol", "forms", "meshes"), 31_795),
    "studio": (("pdvol/studio",), 12_099),
    "tests": (("tests",), 32_760),
    "benchmarks": (("benchmarks",), 4_600),
    "demos": (("demos",), 3_716),
}
"""`core` is all but the studio and its vendored library."""
WORDS = 25_000
"""Of all Markdown pages of docs, and README."""


@cache
def tracked() -> tuple[Path, ...]:
    """The files of the work tree that the last commit has; skips outside of a checkout."""
    try:
        repository = Repository(ROOT)
        files = [ROOT / name for name, _ in repository.files(repository.head())]
    except MissingObject:
        pytest.skip("not a git checkout")
    return tuple(file for file in files if file.is_file())


def below(*folders: str) -> list[Path]:
    """The files of the last commit in some folders, without vendored ones."""
    return [file for file in tracked() if within(file, folders) and "vendor" not in file.parts]


def within(file: Path, folders: tuple[str, ...]) -> bool:
    """Whether a file lies below one of these folders."""
    return any(file.is_relative_to(ROOT / folder) for folder in folders)


def lines(part: str) -> int:
    """Lines of code of a part of `LINES`."""
    files = [file for file in below(*LINES[part][0]) if file.suffix in CODE]
    if part == "core":
        files = [file for file in files if not within(file, LINES["studio"][0])]
    return sum(len(file.read_bytes().splitlines()) for file in files)


def words(files: list[Path]) -> int:
    """Words of Markdown files, without what stands in code blocks and tables' rules."""
    text = "\n".join(file.read_text(encoding="utf-8") for file in files if file.suffix == ".md")
    return len(re.findall(r"\S*\w\S*", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)))


def test_no_file_is_large():
    large = {str(file.relative_to(ROOT)) for file in tracked() if file.stat().st_size > MOST_BYTES["a file"]}
    assert large == LARGE & {str(file.relative_to(ROOT)) for file in tracked()}


def test_no_file_is_long():
    assert not [f.name for f in below("") if f.suffix in CODE and len(f.read_bytes().splitlines()) > 400]


def test_the_tree_is_small():
    assert sum(file.stat().st_size for file in tracked()) <= MOST_BYTES["the tree"]


@pytest.mark.parametrize("part", LINES)
def test_lines_of_code(part):
    assert 0 < lines(part) <= LINES[part][1]


def test_words_of_pages():
    assert 0 < words([ROOT / "README.md", *below("docs")]) <= WORDS
