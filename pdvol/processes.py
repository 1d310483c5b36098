"""Processes that pdvol starts: they are not its MPI ranks, and they end with it."""

import contextlib
import ctypes
import os
import signal

_PR_SET_PDEATHSIG = 1  # of Linux's prctl
# Variables by which MPI launchers mark their ranks: a child must not inherit them.
_LAUNCHER_PREFIXES = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "MPI_", "HYDRA_")


def die_with_parent() -> None:
    """In the child: makes Linux end it when its parent is killed."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def without_launcher() -> dict[str, str]:
    """The environment of a child that is no MPI rank, with one thread."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(_LAUNCHER_PREFIXES)}
    env["OMP_NUM_THREADS"] = "1"
    return env
