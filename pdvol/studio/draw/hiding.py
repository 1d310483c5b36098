"""Which obstacles hide bodies from a camera that goes round the scene."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import lazy_loader
import numpy as np

from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import RunLevel
from pdvol.store.series import in_3d
from pdvol.studio.draw.camera import Camera
from pdvol.studio.draw.framing import outermost

if TYPE_CHECKING:
    import pyvista as pv
else:
    pv = lazy_loader.load("pyvista")

SEEN_THROUGH = 0.3  # opacity of what would hide a body: that of the gallery's glass bowls
HIDDEN = 0.5  # fraction of a body's outline behind an obstacle from which on it counts as hidden
_VIEWS = 12  # angles of a film that are looked at: every 30 degrees
_POINTS = 24  # of a body's outline that are looked at


def hiding_obstacles(
    level: RunLevel, obstacles: Sequence[DrawnObstacle], steps: Sequence[int], cameras: Sequence[Camera]
) -> frozenset[int]:
    """The numbers of the surfaces that hide at least half of a body in one of the pictures.

    Parameters
    ----------
    steps, cameras : as many; of many, a few evenly spread ones are looked at
    """
    surfaces = [number for number, obstacle in enumerate(obstacles) if obstacle.kind == "mesh"]
    found: set[int] = set()
    for index in np.unique(np.linspace(0, len(steps) - 1, _VIEWS).round().astype(int)) if surfaces else ():
        step, camera = min(steps[index], level.steps - 1), cameras[index]
        positions, placed = in_3d(level.positions(step)), level.placed(obstacles, step)
        outlines = [outermost(positions[mine]) for mine in _bodies(level)]
        outlines = [points[:: max(1, len(points) // _POINTS)] for points in outlines]
        for number in surfaces:
            if number not in found:
                shape = pv.PolyData.from_regular_faces(placed[number].vertices(step), placed[number].arrays["faces"])
                if any(_hidden(shape, points, camera.position) >= HIDDEN for points in outlines):
                    found.add(number)
    return frozenset(found)


def _bodies(level: RunLevel) -> list[np.ndarray]:
    """The vertices of each body's surface."""
    surface = np.unique(level.surface)
    owners = level.mesh.point_bodies[surface]
    return [surface[owners == body] for body in np.unique(owners)]


def _hidden(shape: "pv.PolyData", points: np.ndarray, eye: np.ndarray) -> float:
    """The fraction of points (n, 3) [m] that a surface is in front of, seen from `eye` (3,) [m]."""
    return float(np.mean([len(shape.ray_trace(eye, point, first_point=True)[0]) > 0 for point in points]))
