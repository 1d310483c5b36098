"""Runs of the golden shots, and their last states, which are kept.

`./run env PYTHONPATH=tests/helpers python tests/golden/golden.py` records them anew.
"""

import tempfile
from pathlib import Path

import numpy as np

from cli_scenes import pdvol_on_ranks
from on_ranks import end_all, results_on
from pdvol import open_run

HERE = Path(__file__).parent
STRICT = "tolerance=Relative(1e-5)"
"""Newton's: at the usual 1e-3, other rounding of another machine moves single vertices by 5e-4 of the scene's size."""
RUNS = {"spike": ("spike", 1), "drop": ("drop", 1), "driven": ("driven", 1), "drop_on_two_ranks": ("drop", 2)}


def simulate(name: str, out: Path):
    """The stored run of a golden shot, simulated into the folder `out`."""
    shot, ranks = RUNS[name]
    words = ["run", HERE / "scenes.py", "--set", f"shot={shot}", "--set", STRICT, "--out", out]
    (ended,) = results_on((ranks,), pdvol_on_ranks, *words)
    if ended["code"]:
        raise RuntimeError(ended["said"])
    return open_run(out)


def last_states(run) -> dict[str, np.ndarray]:
    """Each level's last positions (n, d) [m]."""
    return {f"level_{level.index}": level.positions(level.steps - 1) for level in run.levels}


def record() -> None:
    """Simulates all shots, and keeps their last states."""
    states = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in RUNS:
            run = simulate(name, Path(folder) / name)
            states |= {f"{name}_{key}": positions for key, positions in last_states(run).items()}
    np.savez_compressed(HERE / "last_states.npz", **states)


if __name__ == "__main__":
    record()
    end_all()
