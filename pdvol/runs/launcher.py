"""How many MPI ranks a level gets, and the command that starts them."""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from mpi4py import MPI

from pdvol.errors import InputError
from pdvol.processes import cores, idle_cores, without_launcher

# vertices for each of three ranks or more: at 3,600 to 3,800 vertices four take 0.50 to 0.58 of one's time
# (benchmarks/ranks/NOTES.md)
VERTICES_A_RANK = 1000
# vertices for two ranks: on two cores they gain less than a fifth with fewer (the same notes)
VERTICES_OF_TWO = 4000
# time of a step [s]: a constant part, and a part for each vertex (benchmarks/dense/NOTES.md)
STEP_TIME, VERTEX_TIME = 2e-3, 1.4e-5
LEVEL_START = 0.3  # time [s] that the process of one level takes to start
# a word of a launcher's --version output, by the library that mpi4py was built with
LAUNCHERS = {"Open MPI": "Open MPI", "MPICH": "HYDRA"}
VERSION_TIME = 20.0  # seconds that a launcher has to print its version
# environment variables that launchers set for their processes
RANK_MARKS = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK")


def chosen_ranks(vertices: int, wanted: int | None, before: int = 0) -> int:
    """The number of ranks for a level with so many vertices.

    Parameters
    ----------
    wanted : the user's number; where it is None, as many as pay and as there are idle cores
    before : the number of ranks of the level's stored steps, which is kept; 0 without stored steps
    """
    if wanted is not None:
        return wanted
    if any(mark in os.environ for mark in RANK_MARKS):
        return 1
    most = before or vertices // VERTICES_A_RANK
    if most < 2 or launcher() is None:
        return 1
    ranks = max(1, min(most, cores() if before else idle_cores()))
    return ranks if before or ranks > 2 or vertices >= VERTICES_OF_TWO else 1


def side_by_side(vertices: Sequence[int], steps: Sequence[int]) -> bool:
    """Whether levels are marched side by side, given their numbers of vertices and of steps to be made, coarsest first:
    the time of the coarser levels, which then passes beside the finest one, exceeds that of starting processes.
    """
    coarse = zip(vertices[:-1], steps[:-1], strict=True)
    hidden = sum(left * (STEP_TIME + VERTEX_TIME * count) for count, left in coarse) if steps[-1] else 0.0
    return hidden > LEVEL_START * len(vertices) and idle_cores() > 1


def require_ranks(wanted: int | None, comm: MPI.Comm) -> None:
    """InputError where so many ranks cannot be started."""
    if wanted is None or wanted == 1:
        return
    if wanted < 1:
        raise InputError(f"--ranks {wanted}: give at least 1")
    if comm.size > 1:
        raise InputError("--ranks starts ranks by itself; leave out mpirun")
    if launcher() is None:
        raise InputError(f"--ranks {wanted}: there is no mpirun of {MPI.get_vendor()[0]}; install it, or use --ranks 1")


@cache
def launcher() -> str | None:
    """The path of a launcher of the MPI library in use; None where there is none."""
    here = str(Path(sys.executable).parent)
    for name in ("mpirun", "mpiexec"):
        path = shutil.which(name, path=os.pathsep.join([here, os.environ.get("PATH", "")]))
        try:
            words = [path or name, "--version"]
            said = subprocess.run(words, capture_output=True, text=True, timeout=VERSION_TIME, env=_environment())
        except (OSError, subprocess.TimeoutExpired):
            continue
        if LAUNCHERS.get(MPI.get_vendor()[0], "?") in said.stdout:
            return path
    return None


def rank_command(ranks: int) -> tuple[list[str], dict[str, str]]:
    """The words that go before a program so that it starts on several ranks of this machine, and their environment."""
    # Ranks of several runs would all be bound to the first cores.
    return [str(launcher()), "-n", str(ranks), "--bind-to", "none"], _environment()


def _environment() -> dict[str, str]:
    """That of a process: launchers refuse root, and more ranks than cores; ranks that wait yield the core."""
    return {
        **without_launcher(),
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_mpi_yield_when_idle": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
        **{name: value for name, value in os.environ.items() if "_MCA_" in name},
    }
