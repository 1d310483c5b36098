"""What a live page draws of a run that is still written: the parts of a level, their places, and views of the run."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from pdvol.scene import Support
from pdvol.store.files import jsonable
from pdvol.store.reader import Run
from pdvol.store.series import in_3d
from pdvol.studio.draw.camera import Camera, content_of_run, fitted_camera
from pdvol.studio.play.document import camera_entry
from pdvol.studio.play.motion import Skin, packed_faces, packed_shape
from pdvol.studio.play.packing import Chunks
from pdvol.studio.shown import upward, upward_in_3d

SURROUNDINGS = 1.5  # diagonals of the bodies within which large obstacles count for the camera
SCENE_SIZE = 5.0  # diagonals of the bodies: an obstacle within this of them is shown whole, since the shot goes there
WIDTH = 4  # numbers of a vertex: graphics cards want rows of whole words


class Frames:
    """The frames of one level of a run, which may still be written.

    Parameters
    ----------
    run : Run
    level : its index
    movable : what a hand may move, by its name in the hand's record: supports, and None for an obstacle
    """

    def __init__(self, run: Run, level: int, movable: Mapping[str, Support | None] = MappingProxyType({})):
        self.run, self.level, self._skin = run, run.levels[level], Skin(run.levels[level])
        self._moving = [
            o.name in movable or "positions" in o.arrays or (o.kind == "plane" and o.arrays["point"].ndim == 2)
            for o in run.obstacles
        ]
        self._movable = movable

    def scene(self) -> dict:
        """The level as the player's pane, with what its places at step 0 are, and the camera for the run's start."""
        chunks, level = Chunks(), self.level
        entry = {
            "positions": chunks.raw(_rows(level.positions(0)[self._skin.vertices])[None]),
            "rest": chunks.raw(_rows(level.rest[self._skin.vertices])),
            "names": list(self.run.info.get("bodies", [])),
            "supports": [
                {"name": name, "vertices": self._held(support)} for name, support in self._movable.items() if support
            ],
            "obstacles": [],
            "details": [],
            "fields": {},
            **packed_faces(level, self._skin, chunks),
        }
        for obstacle, moving in zip(self.run.obstacles, self._moving, strict=True):
            shape = packed_shape(obstacle, chunks) | {"moving": moving, "movable": obstacle.name in self._movable}
            if obstacle.kind == "plane":
                shape["places"] = [np.concatenate(obstacle.plane(0))]
            else:
                shape["positions"] = chunks.raw(_rows(obstacle.vertices(0))[None])
            entry["obstacles"].append(shape)
        camera = camera_entry(view(self.run), upward(self.run))
        return jsonable({"pane": entry, "chunks": chunks.entries, "texts": chunks.texts, "camera": camera})

    def _held(self, support: Support) -> list[int]:
        """The drawn vertices that a support holds."""
        points, held = self.level.mesh.on_the_shape[self._skin.vertices], np.zeros(len(self._skin.vertices), dtype=bool)
        for number, body in enumerate(self.run.info["bodies"]):
            mine = self._skin.bodies == number
            if support.body in ("", body) and mine.any():
                held[mine] = support.where(points[mine])
        return [int(vertex) for vertex in np.flatnonzero(held)]

    def places(self, step: int) -> bytes:
        """The vertices of the bodies at a stored step, then those of each obstacle that moves, as rows of `WIDTH`
        float32 [m]; a plane has two, its point and its normal. Raises as `RunLevel.positions`.
        """
        found = [self.level.positions(step)[self._skin.vertices]]
        if any(self._moving):
            placed = self.level.placed(self.run.obstacles, step)
            moved = [obstacle for obstacle, moving in zip(placed, self._moving, strict=True) if moving]
            found += [np.stack(o.plane(step)) if o.kind == "plane" else o.vertices(step) for o in moved]
        return b"".join(_rows(points).tobytes() for points in found)


def view(run: Run) -> Camera:
    """The camera that shows a run's start: its bodies, the obstacles, and the planes below them. What reaches far shows
    a part, so that the bodies stay large.
    """
    level = run.levels[0]
    bodies = in_3d(level.positions(0))
    low, high = bodies.min(axis=0), bodies.max(axis=0)
    margin = SURROUNDINGS * np.linalg.norm(high - low)
    content = [bodies]
    for obstacle in run.obstacles:
        if obstacle.kind == "plane":
            point, normal = (in_3d(v[None])[0] for v in obstacle.plane(0))
            heights = (bodies - point) @ normal
            content.append((bodies - heights[:, None] * normal)[heights < 2 * margin])
        else:
            vertices = in_3d(obstacle.vertices(0))
            reach = np.maximum(high, vertices.max(axis=0)) - np.minimum(low, vertices.min(axis=0))
            whole = np.linalg.norm(reach) <= SCENE_SIZE * np.linalg.norm(high - low)
            content.append(vertices if whole else np.clip(vertices, low - margin, high + margin))
    return fitted_camera(np.concatenate(content), level.mesh.dim, upward_in_3d(run))


def whole_view(run: Run) -> Camera:
    """The camera that shows all stored states of a run, as pictures frame them."""
    levels = [level for level in run.levels if level.steps]
    content = content_of_run(levels, range(levels[0].steps), run.obstacles)
    return fitted_camera(content, levels[0].mesh.dim, upward_in_3d(run))


def _rows(points: np.ndarray) -> np.ndarray:
    """Points (n, d) as rows of a graphics card."""
    return np.pad(points, [(0, 0), (0, WIDTH - points.shape[1])]).astype("<f4")
