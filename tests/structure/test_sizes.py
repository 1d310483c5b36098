"""Ceilings of the repository: bytes of files and of the tree, lines of code, words of pages. What comes later makes its
own room.

The files are those that git keeps. Without git, which `./run`'s environment lacks, its index is read; outside of a
checkout these tests are skipped.
"""

import re
import struct
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MOST_BYTES = {"a file": 500_000, "the tree": 18_600_000}
LARGE = {"pdvol/studio/play/vendor/three-0.187.0/three.min.js"}
"""Files that may be larger: a library that players and live pages carry whole."""
CODE = (".py", ".c", ".h", ".js")
LINES = {
    # part: (folders or files, lines of code at most)
    "core": (("pdvol", "forms", "meshes"), 32_360),
    "studio": (("pdvol/studio",), 11_470),
    "tests": (("tests",), 34_400),
    "benchmarks": (("benchmarks",), 5_650),
    "demos": (("demos",), 3_850),
}
"""`core` is all but the studio and its vendored library."""
WORDS = 27_700
"""Of all Markdown pages of docs, and README."""


def indexed(index: bytes) -> Iterator[str]:
    """The paths in a git index of version 2 or 3."""
    signature, version, count = struct.unpack(">4sII", index[:12])
    if signature != b"DIRC" or version not in (2, 3):
        pytest.skip(f"the index is of version {version}")
    place = 12
    for _ in range(count):
        extended = index[place + 60] & 0x40
        begin = place + (64 if extended else 62)
        end = index.index(b"\0", begin)
        yield index[begin:end].decode()
        place += (end - place + 8) // 8 * 8


@cache
def tracked() -> tuple[Path, ...]:
    """The files of the work tree that git keeps; skips outside of a checkout."""
    git = ROOT / ".git"
    if git.is_file():  # a worktree names its folder in the repository
        git = ROOT / git.read_text().partition(":")[2].strip()
    if not (git / "index").is_file():
        pytest.skip("not a git checkout")
    files = [ROOT / name for name in indexed((git / "index").read_bytes())]
    return tuple(file for file in files if file.is_file())


def below(*folders: str) -> list[Path]:
    """The files git keeps in some folders, without vendored ones."""
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


def test_the_tree_is_small():
    assert sum(file.stat().st_size for file in tracked()) <= MOST_BYTES["the tree"]


@pytest.mark.parametrize("part", LINES)
def test_lines_of_code(part):
    assert 0 < lines(part) <= LINES[part][1]


def test_words_of_pages():
    assert 0 < words([ROOT / "README.md", *below("docs")]) <= WORDS


def test_a_git_index_is_read():
    entry = lambda name, flags=0, more=b"": bytes(60) + struct.pack(">H", flags | len(name)) + more + name
    padded = lambda entry: entry + bytes(8 - len(entry) % 8)
    both = padded(entry(b"a/b.py")) + padded(entry(b"c", 0x4000, bytes(2)))
    assert list(indexed(struct.pack(">4sII", b"DIRC", 3, 2) + both)) == ["a/b.py", "c"]
