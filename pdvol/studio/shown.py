"""What pictures, exports and pages share: the colours of bodies, obstacles and ground, creases, the way up, pieces of
planes and loops of edges; and where a wedge keeps its runs.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run
from pdvol.store.series import in_3d

GROUND = "#e6e1d8"  # half-spaces
OBSTACLE = "#c9ccd2"  # rigid obstacles
PALETTE = ("#f08a67", "#56a3b5", "#f0bd4f", "#8f80c4", "#7fb685", "#e48fb0", "#6b8fc7", "#b98b6a")  # bodies, levels
SMOOTH_FROM = 1500  # facets of a body: with fewer, single facets are shown, so that a coarse level looks coarse
# degrees between the normals of two facets: sharper edges are creases, as those of a cube or a stair
CREASE_ANGLE = 50.0


def linear_colour(code: str) -> tuple[float, float, float]:
    """Red, green and blue in linear light, 0 to 1, of an sRGB colour such as "#f08a67" (IEC 61966-2-1)."""
    red, green, blue = (_linear(int(code[i : i + 2], 16) / 255) for i in (1, 3, 5))
    return red, green, blue


def srgb_colour(code: str) -> tuple[float, float, float]:
    """Red, green and blue as sRGB stores them, 0 to 1."""
    red, green, blue = (int(code[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


def _linear(value: float) -> float:
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def upward(run: Run, obstacles: Sequence[DrawnObstacle] | None = None) -> np.ndarray:
    """(d,) the unit vector up: against gravity where the run has it, else the first plane's normal, else the last axis.

    `obstacles` stand in for those of the run.
    """
    drawn = run.obstacles if obstacles is None else obstacles
    normals = (obstacle.plane(0)[1] for obstacle in drawn if obstacle.kind == "plane")
    last = np.eye(run.levels[0].rest.shape[1])[-1]
    up = np.asarray(run.info.get("up") or next(normals, last), dtype=float)
    return up / (np.linalg.norm(up) or 1.0)


def upward_in_3d(run: Run) -> np.ndarray:
    """(3,) the unit vector up in pictures and exports: y in 2D."""
    up = upward(run)
    return up if len(up) == 3 else np.array([0.0, 1.0, 0.0])


def across(normal: np.ndarray) -> np.ndarray:
    """The axis that a plane's quad is aligned with: the one that is most nearly within the plane."""
    return np.eye(len(normal))[int(np.argmin(np.abs(normal)))]


def plane_piece(
    point: np.ndarray, normal: np.ndarray, middle: np.ndarray, axis: np.ndarray, reach: float
) -> np.ndarray:
    """Corners (4, 3) [m] of a square piece of a plane; in 2D of a rectangle of the half-space behind the line, whose
    first and last corners are on the line.

    Parameters
    ----------
    point, normal : (d,) of the plane
    middle : (3,) [m] the piece lies about the point of the plane that is nearest to it
    axis : (d,) the direction that the square is aligned with
    reach : half the length of a side [m]
    """
    d = len(normal)
    centre = middle[:d] - ((middle[:d] - point) @ normal) * normal
    if d == 2:
        along = np.array([normal[1], -normal[0]])
        corners = [centre - reach * along, centre - reach * (along + normal)]
        corners += [centre + reach * (along - normal), centre + reach * along]
        return in_3d(np.array(corners))
    e0 = axis - (axis @ normal) * normal
    if np.linalg.norm(e0) < 0.1:  # it has turned until the axis stands across it
        e0 = across(normal) - (across(normal) @ normal) * normal
    e0 /= np.linalg.norm(e0)
    e1 = np.cross(normal, e0)
    return centre + reach * np.array([-e0 - e1, e0 - e1, e0 + e1, -e0 + e1])


def closed_loops(edges: np.ndarray) -> list[list[int]]:
    """Closed chains of directed edges (m, 2), as lists of vertices; open chains are left out."""
    following = {int(a): int(b) for a, b in edges}
    loops, seen = [], set()
    for start in following:
        chain, at = [], start
        while at in following and at not in seen:
            seen.add(at)
            chain.append(at)
            at = following[at]
        if len(chain) > 2 and at == start:
            loops.append(chain)
    return loops


def wedge_run(folder: Path, number: int | str, name: str) -> Path:
    """The run folder of a wedge's variation: `w/17`, or `w/runs/NAME` where pdvol 0.3 has made it.

    Raises
    ------
    InputError
        It lies outside of the wedge's folder.
    """
    old = folder / "runs" / name
    run = old if old.is_dir() else folder / str(number)
    if not run.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"{folder}: the run of variation {number}, {run}, lies outside of that folder; put it there")
    return run
