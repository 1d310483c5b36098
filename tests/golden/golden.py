"""Runs of the golden shots, the digests of their states, and what digests depend on.

`./run env PYTHONPATH=tests/helpers python tests/golden/golden.py` records them anew.

States repeat to the last bit on one kind of processor with one set of libraries. Digests are therefore kept by
`platform_key`; on any other platform the last states, kept as arrays, are compared instead.
"""

import hashlib
import json
import subprocess
import tempfile
from importlib.metadata import version
from pathlib import Path

import numpy as np

from commands import SAFETY, WITHOUT_PICTURE
from pdvol import open_run

HERE = Path(__file__).parent
RUNS = {"spike": ("spike", 1), "drop": ("drop", 1), "driven": ("driven", 1), "drop_on_two_ranks": ("drop", 2)}
LIBRARIES = ("fenics-dolfinx", "petsc4py", "ipctk", "numpy", "scipy")


def platform_key() -> str:
    """Digest of the processor's features and the versions of what computes: digests of states are compared where it is
    the same.
    """
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    processor = sorted({line for line in lines if line.startswith(("flags", "model name"))})
    compiler = subprocess.run(["cc", "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    return hashlib.sha256(repr((processor, compiler, [version(name) for name in LIBRARIES])).encode()).hexdigest()[:16]


def simulate(name: str, out: Path):
    """The stored run of a golden shot, simulated into the folder `out` in a process of its own."""
    shot, ranks = RUNS[name]
    launch = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*launch, *WITHOUT_PICTURE, "run", str(HERE / "scenes.py"), "--set", f"shot={shot}", "--out", str(out)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=SAFETY)
    if ended.returncode:
        raise RuntimeError(ended.stderr)
    return open_run(out)


def digest(run) -> str:
    """Digest of the bytes of all states of all levels."""
    found = hashlib.sha256()
    for level in run.levels:
        for step in range(level.steps):
            found.update(np.ascontiguousarray(level.positions(step)).tobytes())
    return found.hexdigest()[:16]


def last_states(run) -> dict[str, np.ndarray]:
    """Each level's last positions (n, d) [m]."""
    return {f"level_{level.index}": level.positions(level.steps - 1) for level in run.levels}


def record() -> None:
    """Simulates all shots, and keeps their digests for this platform and their last states."""
    file = HERE / "digests.json"
    digests = json.loads(file.read_text()) if file.exists() else {}
    ours = digests.setdefault(platform_key(), {})
    states = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in RUNS:
            run = simulate(name, Path(folder) / name)
            ours[name] = digest(run)
            states |= {f"{name}_{key}": positions for key, positions in last_states(run).items()}
    file.write_text(json.dumps(digests, indent=1, sort_keys=True) + "\n")
    np.savez_compressed(HERE / "last_states.npz", **states)


if __name__ == "__main__":
    record()
