"""The words of README, CONTRIBUTING, CHANGELOG, docs/ and the Python reference: short sentences, units in the heads of
tables.
"""

import inspect
import re
import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest

import pages

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = pages.all_pages(ROOT)
LONGEST = 34
"""Words of a sentence; a piece of code or a formula is one word."""


def ids(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def paragraphs(text: str) -> Iterator[str]:
    """Prose alone: no code, tables, headings and addresses of links. Each entry of a list is a paragraph."""
    text = re.sub(r"^ *(```|~~~|\$\$)[^`\n]*\n.*?^ *\1\s*$", "\n", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^ *(\||#|<!--).*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"^ *([-*+]|\d+\.)\s+", "\n", text, flags=re.MULTILINE)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"`[^`]*`|\$[^$]*\$", "code", text)
    yield from (" ".join(part.split()) for part in re.split(r"\n\s*\n", text))


def sentences(text: str) -> list[str]:
    """A sentence ends in a full stop, question or exclamation mark before a new beginning."""
    parts = (re.split(r"(?<=[.!?])[)*\"]*\s+(?=[A-Z0-9\"(*]|code\b)", paragraph) for paragraph in paragraphs(text))
    return [sentence for part in parts for sentence in part]


def words(sentence: str) -> int:
    return sum(any(c.isalnum() for c in word) for word in sentence.split())


def test_sentences_are_found():
    text = "# A head\n\nOne two (three\nfour). Five `a. B c` six: [seven](x.md#y.z)!\n\n"
    text += "- Eight.\n- Nine $x. Y$ ten.\n\n```\na. B\n```\n"
    assert [words(s) for s in sentences(text) if s] == [4, 4, 1, 3]


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_sentences_of_a_page_are_short(page):
    long = [f"{words(s)} words: {s}" for s in sentences(page.read_text()) if words(s) > LONGEST]
    assert not long, "\n".join(long)


as_rst = runpy.run_path(str(DOCS / "_site" / "docstrings.py"))["as_rst"]


def documented(thing: object) -> Iterator[str]:
    """Docstrings that the reference shows for a name: its own, and those of a class's public methods."""
    yield inspect.getdoc(thing) or ""
    if inspect.isclass(thing):
        for name, member in vars(thing).items():
            if not name.startswith("_") and (inspect.isfunction(member) or isinstance(member, property)):
                yield inspect.getdoc(member) or ""


@pytest.mark.parametrize("path", pages.reference(ROOT))
def test_sentences_of_the_reference_are_short(path):
    texts = ["\n".join(as_rst(text.splitlines())).replace("``", "`") for text in documented(pages.named(path))]
    long = [f"{words(s)} words: {s}" for text in texts for s in sentences(text) if words(s) > LONGEST]
    assert not long, "\n".join(long)


def heads(text: str) -> list[str]:
    """The cells of all first rows of tables."""
    rows = re.findall(r"^ *\|(.*)\| *\n *\|[-: |]+\| *$", text, flags=re.MULTILINE)
    return [cell.strip() for row in rows for cell in row.split("|")]


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_units_in_heads_of_tables_are_in_brackets(page):
    without = re.compile(r"\[.*?\]|'s\b|[0-9.]+ m?s\b")  # units in brackets, genitives, and points in time
    found = heads(page.read_text())
    assert [h for h in found if re.search(r"\b(s|ms|seconds|mm|cm|MB|kg|Pa)\b", without.sub("", h))] == []


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.name)
def test_pictures_have_captions(page):
    """Below a picture, or a group of them, a paragraph in italics says what to see."""
    lines = [line for line in page.read_text().splitlines() if line.strip() and not line.startswith("<!--")]
    followed = zip(lines, [*lines[1:], ""], strict=True)
    assert [a for a, b in followed if a.startswith("![") and not re.match(r"\*[^*]|!\[", b)] == []
