"""Tables in Markdown, numbers in them, and the page that keeps them."""

import math
from pathlib import Path

from benchmarks.common.process import Mistake


def table(head: list[str], rows: list[list[str]]) -> str:
    """One Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in [head, ["---"] * len(head), *rows])


def number(value: float | None, digits: int = 3) -> str:
    """A number with its significant digits, without an exponent where none is needed; a dash for None."""
    if value is None:
        return "-"
    if value == 0 or not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits}g}"
    return f"{value:.{max(digits - 1 - math.floor(math.log10(abs(value))), 0)}f}"


def between(docs: Path, begin: str, end: str) -> tuple[str, str]:
    """The text of a page before and after what a study keeps there, between the lines `begin` and `end`.

    Raises
    ------
    Mistake
        The page does not have both lines, once each.
    OSError
        There is no such page.
    """
    text = docs.read_text()
    if text.count(begin) != 1 or text.count(end) != 1:
        raise Mistake(f"{docs} needs the lines {begin} and {end}, once each")
    before, _, rest = text.partition(begin)
    return before, rest.partition(end)[2]
