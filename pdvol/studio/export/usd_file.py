"""A USD file that is written piece by piece: what has been saved leaves the memory."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pdvol.studio.export.files import written_aside

UNSAVED_BYTES = 16_000_000  # of samples that wait in memory: each save writes the list of all samples anew


class UsdFile:
    """A stage, and how much of it waits to be saved.

    Attributes
    ----------
    stage : pxr.Usd.Stage
    unsaved : bytes of samples since the last save
    """

    def __init__(self, stage: Any):
        self.stage, self.unsaved = stage, 0

    def added(self, size: int) -> None:
        """Samples of `size` bytes are on the stage; many of them go to the disk."""
        self.unsaved += size
        if self.unsaved > UNSAVED_BYTES:
            self.save()

    def save(self) -> None:
        """Write what waits; the samples stay readable."""
        self.stage.Save()
        self.unsaved = 0


@contextmanager
def usd_file(path: Path) -> Iterator[UsdFile]:
    """A stage for `path`, which is written aside and renamed when all has gone well; else nothing is left of it.

    Raises
    ------
    SimulationError
        When the disk cannot be written.
    """
    from pxr import Sdf, Usd

    # USD refuses the name of a layer that an earlier error in this process still holds.
    with written_aside(path, 1, path.suffix, lambda aside: Sdf.Layer.Find(str(aside))) as aside:
        file = UsdFile(Usd.Stage.CreateNew(str(aside)))
        yield file
        file.save()
