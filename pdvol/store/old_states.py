"""States of runs of format 1: `<step>.npy` for each, and `checksums.bin` with the CRC-32 of step k at byte 4 k, 0 for
none.
"""

import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.store.files import mapped_array, read_array


class OldStates:
    """Reads what `States` reads, in the older layout."""

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
