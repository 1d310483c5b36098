"""A level's states in one file that only grows, `states.bin`.

A header has the number of vertices and of dimensions. Then each step has a record of one size: its number, the CRC-32
of its positions, and the positions (n, d) float64 [m], all little-endian. A kill leaves at most a part of a record at
the end, which readers ignore and the next record replaces. The file is synced to the disk once a second at most, so
that a power cut costs the steps of the last second; what it may leave of them is found by their checksums.
"""

import math
import os
import struct
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from io import FileIO
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.store.files import append, mapped_array, not_written, read_array, sync_file, write_bytes

NAME = "states.bin"
SYNC_PAUSE = 1.0  # seconds between two syncs of a file to the disk, at least
HEADER = struct.Struct("<8sQQ")  # MAGIC, n, d
HEAD = struct.Struct("<QQ")  # of a record: step, checksum
MAGIC = b"pdvol st"


class States:
    """The states of a level's folder, read and written as arrays of `shape` (n, d)."""

    def __init__(self, folder: Path, shape: tuple[int, ...]):
        self.file, self.shape = folder / NAME, shape
        self._header = HEADER.pack(MAGIC, *shape)
        self._size = HEAD.size + 8 * math.prod(shape)
        self._synced = -math.inf

    def create(self) -> None:
        """Make the file without a state, in the place of one that is there."""
        write_bytes(self.file, self._header)

    def count(self) -> int:
        """How many whole records there are; 0 where there is no file of this shape."""
        with suppress(OSError), open(self.file, "rb", buffering=0) as file:  # anew: network file systems then look
            return self._count_in(file)
        return 0

    def stamp(self, step: int) -> tuple[int, ...] | None:
        """What changes when a step is computed again; None where it is not stored."""
        head = self._bytes(step, HEAD.size)
        return HEAD.unpack(head) if len(head) == HEAD.size else None

    def read(self, step: int) -> np.ndarray:
        """The positions at the end of a step; InputError where they are damaged."""
        record = self._bytes(step, self._size)
        if len(record) < self._size or HEAD.unpack_from(record) != (step, zlib.crc32(record[HEAD.size :])):
            raise InputError(f"{self.file}, step {step}, is damaged: its numbers are not those that were stored")
        positions = np.frombuffer(record, "<f8", offset=HEAD.size).reshape(self.shape).astype(np.float64)
        if not np.isfinite(positions).all():
            raise InputError(f"{self.file}, step {step}, holds numbers that are not finite")
        return positions

    def write(self, step: int, positions: np.ndarray) -> None:
        """Store positions (n, d) float64 as the last step; SimulationError where the disk cannot be written."""
        data, now = np.ascontiguousarray(positions, "<f8").tobytes(), time.monotonic()
        append(self.file, HEAD.pack(step, zlib.crc32(data)) + data, self._begin(step))
        if now >= self._synced + SYNC_PAUSE:
            self.sync()

    def extend(self, read: Callable[[int], np.ndarray], count: int) -> None:
        """Store what `read` gives for the steps that lack up to `count`."""
        if not self.file.exists():
            self.create()
        for step in range(self.count(), count):
            self.write(step, read(step))
        self.sync()

    def sync(self) -> None:
        """Make the states outlive a power cut; SimulationError where the disk cannot be written."""
        try:
            sync_file(self.file)
        except OSError as error:
            raise not_written(self.file, error) from error
        self._synced = time.monotonic()

    def keep(self, steps: int) -> None:
        """Remove the states from `steps` on."""
        if self.file.stat().st_size > self._begin(steps):
            os.truncate(self.file, self._begin(steps))

    def repair(self) -> int:
        """Cut the file where the first state is damaged or not whole; returns the number of states.

        Raises
        ------
        InputError
            It is not a file of states of this shape.
        """
        if not self.file.exists():
            self.create()
        with open(self.file, "rb", buffering=0) as file:
            if file.read(len(self._header)) != self._header:
                n, d = self.shape
                raise InputError(f"{self.file} does not hold states of {n} vertices in {d}D: put it back or remove it")
        steps = 0
        with suppress(InputError):
            while True:
                self.read(steps)
                steps += 1
        self.keep(steps)
        return steps

    def _count_in(self, file: FileIO) -> int:
        if file.read(len(self._header)) != self._header:
            return 0
        return (os.fstat(file.fileno()).st_size - len(self._header)) // self._size

    def _begin(self, step: int) -> int:
        return len(self._header) + step * self._size

    def _bytes(self, step: int, size: int) -> bytes:
        """The first bytes of a whole record, none where there is none."""
        try:
            with open(self.file, "rb", buffering=0) as file:
                if not 0 <= step < self._count_in(file):
                    return b""
                file.seek(self._begin(step))
                return file.read(size)
        except FileNotFoundError:
            return b""
        except OSError as error:
            raise InputError(f"{self.file} cannot be read: {error.strerror or error}") from error


class OldStates:
    """Reads what `States` reads, of runs of format 1: `<step>.npy` for each, and `checksums.bin` with the CRC-32 of
    step k at byte 4 k, 0 for none.
    """

    def __init__(self, folder: Path, shape: tuple[int, ...]):
        self._folder, self._shape = folder, shape
        self._known = 0

    def count(self) -> int:
        """How many whole states there are in a row from step 0 on."""
        with suppress(InputError):
            while True:
                mapped_array(self._file(self._known), self._shape)
                self._known += 1
        return self._known

    def stamp(self, step: int) -> tuple[int, ...] | None:
        """What changes when a step is computed again; None where it is not stored."""
        try:
            found = self._file(step).stat()
        except FileNotFoundError:
            return None
        return found.st_ino, found.st_mtime_ns

    def read(self, step: int) -> np.ndarray:
        """The positions at the end of a step; InputError where they are damaged."""
        positions, sums = read_array(self._file(step), self._shape), self._folder / "checksums.bin"
        stored = sums.read_bytes()[4 * step : 4 * step + 4] if sums.exists() else b""
        if int.from_bytes(stored, "little") not in (0, zlib.crc32(np.ascontiguousarray(positions).data)):
            raise InputError(f"{self._file(step)} is damaged: its numbers are not those that were stored")
        return positions

    def remove(self) -> None:
        """Remove the files, which were converted."""
        for file in (*self._folder.glob("[0-9]*.npy"), self._folder / "checksums.bin"):
            file.unlink(missing_ok=True)

    def _file(self, step: int) -> Path:
        return self._folder / f"{step:06d}.npy"
