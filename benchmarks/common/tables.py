"""Tables in Markdown, numbers in them, and the files that keep them."""

import json
import math
from collections.abc import Callable, Iterable
from pathlib import Path

from benchmarks.common.process import Mistake, machine
from benchmarks.common.study import each


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


class Page:
    """The part of a page that the study `name` keeps, between its two lines.

    Raises
    ------
    Mistake
        The page does not have both lines, once each.
    OSError
        There is no such page.
    """

    def __init__(self, file: Path, name: str, what: str = "tables"):
        self.file, self.begin = file, f"<!-- benchmarks.{name}: {what} -->"
        self.end = f"<!-- benchmarks.{name}: end -->"
        self._split()

    def _split(self) -> tuple[str, str, str]:
        text = self.file.read_text()
        if text.count(self.begin) != 1 or text.count(self.end) != 1:
            raise Mistake(f"{self.file} needs the lines {self.begin} and {self.end}, once each")
        before, _, rest = text.partition(self.begin)
        kept, _, after = rest.partition(self.end)
        return before, kept.strip("\n"), after

    @property
    def text(self) -> str:
        """What is kept."""
        return self._split()[1]

    def write(self, text: str) -> None:
        """Keeps another text."""
        before, _, after = self._split()
        self.file.write_text(f"{before}{self.begin}\n{text}\n{self.end}{after}")


class Kept:
    """The records of a study by row, kept in a file, and their table, each as soon as it exists.

    Parameters
    ----------
    file : JSON, whose folder is made; records of an earlier command stay
    order : names of rows in the order of the table
    head, cells : of the table; `cells` are the lines of a row's name and record
    page : that keeps the table; without one it is a file beside the records
    around : what stands above and below the table, of all records
    """

    def __init__(
        self, file: Path, order, head: list[str], cells, page: Page | None = None, around=lambda rows: ("", "")
    ):
        file.parent.mkdir(parents=True, exist_ok=True)
        self._file, self._order, self._page = file, list(order), page
        self._head, self._cells, self._around = head, cells, around
        self.rows = json.loads(file.read_text())["rows"] if file.is_file() else {}

    def run(self, names: Iterable[str], measure: Callable[[str], dict]) -> None:
        """Measures rows, keeps each one, and prints the table."""

        def kept(name: str) -> dict:
            self.add(name, record := measure(name))
            return record

        each(names, kept, self._cells)
        print(self)

    def add(self, name: str, record: dict) -> None:
        """Adds or replaces a row, and writes everything."""
        rows = {**self.rows, name: record}
        self.rows = {name: rows[name] for name in self._order if name in rows}
        self._file.write_text(json.dumps({"machine": machine(), "rows": self.rows}, indent=1) + "\n")
        if self._page is None:
            self._file.with_suffix(".md").write_text(f"{self}\n")
        else:
            self._page.write(str(self))

    def __str__(self) -> str:
        """The machine and the table."""
        own, (above, below) = machine(), self._around(self.rows)
        made = table(self._head, [line for name, record in self.rows.items() for line in self._cells(name, record)])
        return "\n\n".join(filter(None, [f"{own['processor']}, {own['cores']} cores.", above, made, below]))
