"""The benchmark of contact laws reproduces the figures in docs/contact.md, and reports how a scene failed."""

from pathlib import Path

import pytest

from benchmarks.contact_laws import __main__ as contact_laws

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("column", "arguments"),
    [(1, ("convergent", 2)), (4, ("classic", 2)), (5, ("classic", 2, 0.6)), (6, ("semi-implicit", 2))],
)
def test_the_gaps_in_the_documentation_are_reproduced(column, arguments):
    table = (ROOT / "docs" / "contact.md").read_text().split("gap [dhat]: convergent")[1]
    (row,) = [line.split("|")[1:-1] for line in table.split("\n\n")[0].splitlines() if line.startswith("| 2 |")]
    told = float(row[column])
    assert contact_laws.rest(*arguments)["gap"] == pytest.approx(told, abs=2e-4)


def test_a_failure_is_a_row():
    def fails():
        raise contact_laws.PdvolError("level 0, step 3")

    assert "level 0, step 3" in contact_laws.effort_row("impact", "classic", contact_laws.attempt(fails))
