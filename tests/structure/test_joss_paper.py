"""The paper for the Journal of Open Source Software has what the journal asks for, as far as a program can see."""

import re
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "joss"
HEAD, TEXT = re.fullmatch(r"---\n(.*?)\n---\n(.*)", (FOLDER / "paper.md").read_text(), re.DOTALL).groups()
ENTRIES = dict(re.findall(r"^@\w+\{(\w+),\n(.*?)^\}", (FOLDER / "paper.bib").read_text(), re.MULTILINE | re.DOTALL))
SECTIONS = [
    "Summary",
    "Statement of need",
    "State of the field",
    "Software design",
    "Research impact statement",
    "AI usage disclosure",
    "Acknowledgements",
    "References",
]
"""Those that the journal requires, in its order."""


def test_it_has_the_required_sections_and_length():
    assert re.findall(r"^# (.+)$", TEXT, re.MULTILINE) == SECTIONS
    parts = re.split(r"^# .+$", TEXT, flags=re.MULTILINE)[1:-1]
    assert all(len(part.split()) > 15 for part in parts)
    assert 750 <= sum(len(part.split()) for part in parts) <= 1750


def test_its_head_names_what_the_journal_prints():
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(
        re.findall(r"^(\w+):", HEAD, re.MULTILINE)
    )
    cited = (FOLDER.parent / "CITATION.cff").read_text().split("\nversion")[0]
    assert re.findall(r"^  - name: (.+)$", cited, re.MULTILINE) == re.findall(
        r"^  - name: (.+)$", HEAD.split("affiliations:\n")[0], re.MULTILINE
    )


def test_every_citation_has_an_entry_and_every_entry_a_citation():
    assert len(ENTRIES) > 10
    assert set(re.findall(r"@(\w+)", TEXT)) == set(ENTRIES)


def test_every_entry_says_where_it_is_found():
    for name, fields in ENTRIES.items():
        assert {"author", "title", "year"} <= set(re.findall(r"^  (\w+) = \{", fields, re.MULTILINE)), name
        assert re.search(r"^  (doi = \{10\.|url = \{https://)", fields, re.MULTILINE), name


def test_its_figures_exist_and_are_mentioned():
    figures = re.findall(r"^!\[.*\\label\{(\S+)\}\]\((\S+?)\)", TEXT, re.MULTILINE)
    assert len(figures) == 2 and all((FOLDER / path).is_file() for _, path in figures)
    assert {name for name, _ in figures} == set(re.findall(r"\\autoref\{(\S+?)\}", TEXT))
