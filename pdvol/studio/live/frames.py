"""What a live page draws of a run that is still written: the parts of a level, their places, and views of the run."""

import numpy as np

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
    """

    def __init__(self, run: Run, level: int):
        self.run, self.level, self._skin = run, run.levels[level], Skin(run.levels[level])
        self._moving = [
            "positions" in obstacle.arrays or (obstacle.kind == "plane" and obstacle.arrays["point"].ndim == 2)
            for obstacle in run.obstacles
        ]

    def scene(self) -> dict:
        """The level as the player's pane, with what its places at step 0 are, and the camera for the run's start."""
        chunks, level = Chunks(), self.level
        entry = {
            "positions": chunks.raw(_rows(level.positions(0)[self._skin.vertices])[None]),
            "obstacles": [],
            "details": [],
            "fields": {},
            **packed_faces(level, self._skin, chunks),
        }
        for obstacle, moving in zip(self.run.obstacles, self._moving, strict=True):
            shape = packed_shape(obstacle, chunks) | {"moving": moving}
            if obstacle.kind == "plane":
                shape["places"] = [np.concatenate(obstacle.plane(0))]
            else:
                shape["positions"] = chunks.raw(_rows(obstacle.vertices(0))[None])
            entry["obstacles"].append(shape)
        camera = camera_entry(view(self.run), upward(self.run))
        return jsonable({"pane": entry, "chunks": chunks.entries, "texts": chunks.texts, "camera": camera})

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
