"""Tables in Markdown, and numbers in them."""

import math


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
