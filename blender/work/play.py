"""What a run has stored, as point caches in the coordinates of Blender's objects.

pdvol exports metres of the scene. A Mesh Cache modifier takes coordinates of its object, in the units of Blender's
scene; where the object itself moves, those of the frame.
"""

import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ..shot.files import Places, read_pc2, write_pc2, write_text

EXPORTED = ("{}_render.pc2", "{}_render_1.pc2")
"""What pdvol's export calls the render meshes of a body, in their order."""


@dataclass(frozen=True)
class Played:
    """An object that follows a body.

    Attributes
    ----------
    name : of the body
    label : of the object in Blender
    caches : how many it has: one, or another one for renders, where its mesh has other vertices
    metres : a unit of Blender's scene [m]
    worlds : 4 x 4 matrices from the object's coordinates to Blender's scene: one for all frames, or one for each
    """

    name: str
    label: str
    caches: int
    metres: float
    worlds: list

    @property
    def files(self) -> list[str]:
        """Names of its caches: that of the 3D view, and that of renders where there is one."""
        return [f"{self.name}.pc2", f"{self.name}_render.pc2"][: self.caches]


OBJECTS = "objects.json"
"""The file that keeps what `make_caches` needs, also for a later session."""


def write_objects(folder: Path, played: Sequence[Played]) -> None:
    """Keep which objects follow, and how, in a folder."""
    write_text(folder / OBJECTS, json.dumps([asdict(thing) for thing in played], indent=1))


def read_objects(folder: Path) -> list[Played]:
    """What `write_objects` has kept; empty where nothing was."""
    try:
        return [Played(**entry) for entry in json.loads((folder / OBJECTS).read_text())]
    except (OSError, ValueError, TypeError):
        return []


def make_caches(places: Places, exported: Path, number: int, level: int) -> int:
    """The caches of a level of a run, from its export by pdvol, which is removed; how many frames they have."""
    frames = 0
    for thing in read_objects(places.play(number)):
        for cache, export in zip(thing.files, EXPORTED, strict=False):
            world = read_pc2(exported / f"level_{level}" / export.format(thing.name))
            frames = len(world)
            write_pc2(places.caches(number, level) / cache, to_object(world, thing.worlds, thing.metres))
            del world  # a view of the file
    shutil.rmtree(exported, ignore_errors=True)
    return frames


def to_object(points: np.ndarray, worlds: Sequence, metres: float) -> np.ndarray:
    """Points (k, n, 3) [m] of the scene in an object's own coordinates; `worlds` and `metres` as of `Played`."""
    inverses = np.linalg.inv(np.asarray(worlds, dtype=float))
    chosen = inverses[np.minimum(np.arange(len(points)), len(inverses) - 1)]
    moved = np.einsum("kij,knj->kni", chosen[:, :3, :3], np.asarray(points, dtype=float) / metres)
    return moved + chosen[:, None, :3, 3]


def played_frames(places: Places, number: int, level: int) -> int:
    """How many frames the caches of a level have; 0 where there are none."""
    counts = []
    for thing in read_objects(places.play(number)):
        try:
            counts += [len(read_pc2(places.caches(number, level) / file)) for file in thing.files]
        except (OSError, ValueError):
            return 0
    return min(counts, default=0)
