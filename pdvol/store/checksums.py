"""Checksums of a level's states, in `checksums.bin`: the CRC-32 of step k's positions at byte 4 k, little-endian.

Zero stands for none, as of states that were stored before there were checksums. An entry is written before its state,
and removed with it: a kill leaves no state with the entry of another one.
"""

import os
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np

NAME = "checksums.bin"
_BYTES = 4


def checksum(positions: np.ndarray) -> int:
    """CRC-32 of positions (n, d) float64."""
    return zlib.crc32(np.ascontiguousarray(positions).data)


def write_checksum(folder: Path, step: int, positions: np.ndarray) -> None:
    """Store the checksum of a step in a level's folder. Where the disk cannot be written there is none: the
    state, which is written next, reports it.
    """
    with suppress(OSError):
        file = os.open(folder / NAME, os.O_WRONLY | os.O_CREAT, 0o666)
        try:
            os.pwrite(file, checksum(positions).to_bytes(_BYTES, "little"), _BYTES * step)
        finally:
            os.close(file)


def keep_checksums(folder: Path, steps: int) -> None:
    """Remove the checksums from `steps` on."""
    if (folder / NAME).exists():
        os.truncate(folder / NAME, min(_BYTES * steps, (folder / NAME).stat().st_size))


def differs(folder: Path, step: int, positions: np.ndarray) -> bool:
    """Whether positions are not those of which the checksum was stored; False where there is none."""
    try:
        with open(folder / NAME, "rb") as file:
            file.seek(_BYTES * step)
            stored = int.from_bytes(file.read(_BYTES), "little")
    except OSError:
        return False
    return stored not in (0, checksum(positions))
