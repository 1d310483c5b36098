"""Runs of the golden shots, and their last states, which are kept.

`./run env PYTHONPATH=tests/helpers python tests/golden/golden.py` records them anew.
"""

import subprocess
import tempfile
from pathlib import Path

import numpy as np

from commands import SAFETY, WITHOUT_PICTURE
from pdvol import open_run

HERE = Path(__file__).parent
RUNS = {"spike": ("spike", 1), "drop": ("drop", 1), "driven": ("driven", 1), "drop_on_two_ranks": ("drop", 2)}


def simulate(name: str, out: Path):
    """The stored run of a golden shot, simulated into the folder `out` in a process of its own."""
    shot, ranks = RUNS[name]
    launch = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*launch, *WITHOUT_PICTURE, "run", str(HERE / "scenes.py"), "--set", f"shot={shot}", "--out", str(out)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=SAFETY)
    if ended.returncode:
        raise RuntimeError(ended.stderr)
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
