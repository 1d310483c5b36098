"""The examples of the reports to ipctk: one shows the fault until ipctk mends it, the other still runs."""

import re
from pathlib import Path

REPORTS = Path(__file__).resolve().parents[2] / "benchmarks" / "ipctk_reports"


def example(name):
    """Runs the report's example; its names."""
    names = {}
    exec(re.search(r"```python\n(.*?)```", (REPORTS / f"{name}.md").read_text(), re.S)[1], names)
    return names


def test_edges_that_run_in_opposite_directions_lose_a_part():
    """When this fails because the first jump is gone, `Candidates` need not turn edges any longer."""
    jump = example("edge_edge_parts")["largest_jump"]
    assert jump([3, 4])[0] > 0.1
    assert jump([4, 3])[0] < 1e-6


def test_reading_pairs_one_by_one_is_slower_than_making_them():
    names = example("bulk_access")
    assert len(names["collisions"]) > 10_000
    assert names["ms_read"] > names["ms_gradient"]
