"""The example of the report to ipctk shows the fault until ipctk repairs it."""

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
