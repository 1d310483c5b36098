"""README is read in two minutes: its parts in order, its length, and its figures, which are those of the pages."""

import re
from pathlib import Path

import pages

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
TEXT = README.read_text()
LONGEST = 130
"""Lines: what one reads in two minutes."""
PARTS = [
    "The loop",
    "A scene",
    "From Python",
    "Beside others",
    "Limits",
    "Where to read on",
    "How to cite",
]


def section(title: str) -> str:
    """The text of a part."""
    return TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]


def code(title: str) -> list[str]:
    """The lines of a part's one block of code, without empty ones."""
    (found,) = re.findall(r"^```\w*\n(.*?)^```", section(title), re.MULTILINE | re.DOTALL)
    return [line for line in found.splitlines() if line.strip()]


def rows(text: str) -> list[list[str]]:
    """The cells of all rows of tables."""
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]


def test_parts_and_their_lengths():
    lines = TEXT.splitlines()
    assert len(lines) <= LONGEST
    assert [line[3:] for line in lines if line.startswith("## ")] == PARTS
    assert TEXT.count("![") == 1 and "docs/gallery/sheet.png" in TEXT.split("\n## ")[0]
    first = next(k for k, line in enumerate(lines, 1) if line.startswith("./run pdvol"))
    install = next(k for k, line in enumerate(lines, 1) if "docs/install.md" in line)
    assert first <= 20 and install <= 20
    assert len(code("The loop")) == 5 and len(code("From Python")) == 5 and len(code("A scene")) <= 15
    assert len([line for line in section("Limits").splitlines() if line.strip()]) <= 10
    assert "CITATION.cff" in section("How to cite")


def test_each_block_of_code_is_taken_up_by_a_test():
    """Python runs in test_pages.py, and so does the loop; the first command is what the loop's preview refines."""
    kinds = [(block.language, len(block.commands)) for block in pages.blocks(README)]
    assert kinds == [("", 1), ("", 5), ("python", 0), ("python", 0)]


def test_figures_of_the_loop_are_those_of_its_page():
    page = (ROOT / "docs" / "gallery" / "ball_on_spike.md").read_text()
    (sizes,) = [cells[1:] for cells in rows(page) if cells[0] == "vertices, cells"]
    places = [re.findall(r"[-+]0\.\d+", text) for text in (page.split("![")[0], page.split("## What it shows")[1])]
    for name, figures in (
        ("vertices", [size.split(", ")[0] for size in sizes]),
        ("one by one", places[0]),
        ("refined", places[1][: len(sizes)]),
    ):
        (row,) = [cells for cells in rows(section("The loop")) if cells[0].startswith(name)]
        assert row[1:] == figures and len(figures) == 5
