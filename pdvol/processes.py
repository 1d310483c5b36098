"""Processes that pdvol starts: they are no ranks of ours, and do not outlive it."""

import contextlib
import ctypes
import os
import signal

_PR_SET_PDEATHSIG = 1  # of Linux's prctl
# A child must not look like a rank of ours.
_LAUNCHER_PREFIXES = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "MPI_", "HYDRA_")


def die_with_parent() -> None:
    """In the child: let Linux end it when we are killed, or it would work on for nobody."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def without_launcher() -> dict[str, str]:
    """The environment of a child that is not one of our MPI ranks, with one thread."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(_LAUNCHER_PREFIXES)}
    env["OMP_NUM_THREADS"] = "1"
    return env
