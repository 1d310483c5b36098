"""docs/paper.md: every equation and figure of the paper has a file, a test and a picture, and they exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "paper.md"
EQUATIONS, FIGURES = 19, 21
"""Numbers of the paper: equations with a number, appendices included, and figures with a caption."""
LINK = re.compile(r"\[([^\]]+)\]\(([^)#]+)(?:#[^)]*)?\)")
PICTURES = (".png", ".webp")


def rows(title):
    """Cells of a section's table, without its head."""
    section = PAGE.read_text().partition(f"\n## {title}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[1:]]


ROWS = [*rows("Equations"), *rows("Methods without a number"), *rows("Figures")]


def numbers(title):
    """What the first cells of a table begin with."""
    heads = [re.match(r"[\d, ]+(?=:| and)", row[0]) for row in rows(title)]
    return [int(number) for head in heads if head for number in head[0].split(",")]


def test_nothing_is_left_out():
    assert numbers("Equations") == list(range(1, EQUATIONS + 1))
    assert numbers("Figures") == list(range(1, FIGURES + 1))
    assert len(ROWS) > 45


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0][:40])
def test_files_tests_and_pictures_exist(row):
    assert len(row) == 4 and all(row)
    files, tests, shown = (LINK.findall(cell) for cell in row[1:])
    assert files and tests and shown
    for name, target in (*files, *tests):
        file = (PAGE.parent / target).resolve()
        assert file.is_file() and file.suffix == ".py", target
        assert re.search(rf"^(?:def |class |){name.strip('`')}\b", file.read_text(), re.MULTILINE), (name, target)
    assert all(name.startswith("`test_") and Path(target).name.startswith("test_") for name, target in tests)
    targets = [PAGE.parent / target for _, target in shown]
    assert all(target.is_file() for target in targets), shown
    assert any(target.suffix in PICTURES for target in targets), "a picture, not only a page"
