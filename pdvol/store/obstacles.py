"""Obstacles for pictures: `obstacles.json` names them, `obstacles/<i>.npz` holds the arrays of each.

| kind | arrays |
|---|---|
| plane | `point` (d,) and `normal` (d,), or (steps + 1, d) each when it moves |
| mesh | `vertices` (n, 3), `faces` (m, 3); `positions` (steps + 1, n, 3) when it moves; `opacity` () below 1 |
| polyline | `vertices` (n, 2), `edges` (m, 2); `positions` (steps + 1, n, 2) when it moves |

Where contact held motions back, `levels/<l>/late_<step>.npz` has their true places at that level and step: `<i>.point`,
`<i>.normal` or `<i>.vertices` of each obstacle i that moves. A polyline whose edges form loops is a filled outline, any
other a line.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.store.files import read_list, write_list

# By kind of obstacle: the arrays that it must have.
NEEDED_ARRAYS = {"plane": ("point", "normal"), "mesh": ("vertices", "faces"), "polyline": ("vertices", "edges")}


@dataclass(frozen=True, eq=False)
class DrawnObstacle:
    """One stored obstacle.

    Attributes
    ----------
    kind : "plane", "mesh" or "polyline"
    arrays : dict of numpy arrays, as in the module's table
    """

    name: str
    kind: str
    arrays: dict[str, np.ndarray]

    def __post_init__(self) -> None:
        if self.kind not in NEEDED_ARRAYS:
            raise InputError(f"obstacle {self.name!r}: kind {self.kind!r} must be one of {', '.join(NEEDED_ARRAYS)}")
        missing = [key for key in NEEDED_ARRAYS[self.kind] if key not in self.arrays]
        if missing:
            raise InputError(f"obstacle {self.name!r}: a {self.kind} needs the arrays {missing}")

    @classmethod
    def of(cls, entry: Mapping) -> "DrawnObstacle":
        """Of a mapping with `name`, `kind` and the arrays."""
        arrays = {key: np.asarray(value) for key, value in entry.items() if key not in ("name", "kind")}
        return cls(str(entry["name"]), str(entry["kind"]), arrays)

    def plane(self, step: int) -> tuple[np.ndarray, np.ndarray]:
        """A plane's point (d,) [m] and unit normal (d,) at a step; after the last stored step it rests."""
        point, normal = (_at(self.arrays[key], step, moves=self.arrays[key].ndim == 2) for key in ("point", "normal"))
        return point, normal / np.linalg.norm(normal)

    def vertices(self, step: int) -> np.ndarray:
        """Vertices (n, d) [m] of a mesh or polyline at a step."""
        moving = self.arrays.get("positions")
        return self.arrays["vertices"] if moving is None else _at(moving, step, moves=True)

    def held(self, arrays: Mapping[str, np.ndarray]) -> "DrawnObstacle":
        """The same obstacle at rest where it was held back: with these `point` and `normal`, or `vertices`."""
        kept = {key: value for key, value in self.arrays.items() if key != "positions"}
        return DrawnObstacle(self.name, self.kind, {**kept, **arrays})


def _at(values: np.ndarray, step: int, moves: bool) -> np.ndarray:
    return values[min(step, len(values) - 1)] if moves else values


def write_obstacles(folder: Path, obstacles: Sequence[Mapping]) -> None:
    """Store obstacles: mappings with `name`, `kind` and the arrays of the module's table. Replaces those stored before.

    Raises
    ------
    InputError
        When a kind is unknown or an array is missing; nothing is written then.
    """
    drawn = [DrawnObstacle.of(entry) for entry in obstacles]
    write_list(folder, "obstacles", [{"name": o.name, "kind": o.kind} for o in drawn], [o.arrays for o in drawn])


def read_obstacles(folder: Path) -> tuple[DrawnObstacle, ...]:
    """The stored obstacles, none if none were stored; InputError if a file is damaged (states do not depend on it)."""
    return read_list(folder, "obstacles", lambda _, entry, arrays: DrawnObstacle(entry["name"], entry["kind"], arrays))
