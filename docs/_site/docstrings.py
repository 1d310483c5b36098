"""Docstrings of pdvol (numpydoc's sections, `code`, units in brackets) as reStructuredText for autodoc.

An entry of a section is `names : text`, with more lines of text indented below it. It becomes an item of a list.
Docstrings use nothing else of reStructuredText, so its special characters are taken as they are.
"""

import dataclasses
import re
from collections.abc import Iterator, Sequence
from inspect import isfunction
from typing import Any

SHORT = 60  # letters of a line that ends because it is complete, not because the docstring is as wide as it may be
SECTIONS = ("Parameters", "Attributes", "Returns", "Yields", "Raises")


def plain(text: str) -> str:
    """Text with its `code` kept and without other special meaning."""
    parts = re.split(r"(`[^`]+`)", text)
    return "".join(f"`{part}`" if part.startswith("`") else re.sub(r"([*|_\\`])", r"\\\1", part) for part in parts)


def sections(lines: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """(title, lines) of a docstring's parts; the first one has no title."""
    title, body, skip = "", [], False
    for line, after in zip(lines, [*lines[1:], ""], strict=True):
        if skip:
            skip = False
        elif line.strip() in SECTIONS and after.strip() and set(after.strip()) == {"-"}:
            yield title, body
            title, body, skip = line.strip(), [], True
        else:
            body.append(line)
    yield title, body


def entries(lines: Sequence[str]) -> Iterator[tuple[str, str]]:
    """(names, text) of a section's entries."""
    found: list[tuple[str, list[str]]] = []
    for line in lines:
        if line and not line[0].isspace():
            names, _, text = line.partition(" : ")
            found.append((names, [text] if text else []))
        elif line.strip() and found:
            found[-1][1].append(line.strip())
    for names, text in found:
        # numpydoc's own form: a short line with the kind, and what it is in the next one
        if len(text) > 1 and len(text[0]) < SHORT and text[1][0].isupper() and text[0][-1] not in ".:;,":
            text[0] += "."
        yield names, " ".join(text)


def as_rst(lines: Sequence[str]) -> list[str]:
    """The lines of a docstring, for autodoc."""
    made: list[str] = []
    for title, body in sections(lines):
        if not title:
            made += [plain(line) for line in body]
            continue
        made += ["", f"**{title}**", ""]
        made += [f"- **{plain(names)}**" + (f": {plain(text)}" if text else "") for names, text in entries(body)]
        made.append("")
    return made


def process(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = as_rst(lines)


def skip(app: Any, what: str, name: str, obj: Any, skipped: bool, options: Any) -> bool | None:
    """Default values of fields that are functions or objects are no members."""
    owner = app.env.temp_data.get("autodoc:class") or app.env.current_document.get("autodoc:class")
    if isfunction(obj) and obj.__name__ != name:
        return True
    return True if dataclasses.is_dataclass(obj) and not isinstance(obj, type) and owner is not None else None


def setup(app: Any) -> dict:
    app.connect("autodoc-process-docstring", process)
    app.connect("autodoc-skip-member", skip)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
