"""What an animation shows of a level: the surfaces of its bodies, obstacles, and planes as finite quads.

Each part has one mesh, and positions at every step. Vectors have three components in 2D too, with z = 0. Vertices of a
body are those of its boundary (all of a 2D level), once each and in the input's order.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pdvol.geometry.distances import is_closed
from pdvol.registry import SHOWN_SURFACES
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel
from pdvol.store.render_meshes import StoredRender
from pdvol.store.series import in_3d
from pdvol.studio.shown import GROUND, OBSTACLE, PALETTE, across, closed_loops, plane_piece

PLANE_REACH = 1.5  # half the side of a plane's quad, as a multiple of the diagonal of the box that the bodies pass
OUTLINE_WIDTH = 0.005  # width of an open polyline, as a multiple of the same diagonal
RENDER, CONTACT_SURFACE, BOTH = SHOWN_SURFACES
BOX_STATES = 30  # states of a level that the box of its motion is taken from
LONGEST_NAME = 60  # characters of a body's name that are kept: file formats and their readers have limits


Faces = Sequence[Sequence[int]] | np.ndarray
"""The corners of each polygon."""
Corners = Callable[[np.ndarray], np.ndarray]
"""The mesh's vertices (n, 3) of an obstacle's vertices."""


@dataclass(frozen=True, eq=False)
class Part:
    """One mesh of an animation.

    Attributes
    ----------
    name : str
        Of letters, digits and underscores; no other part of the same run has it.
    label : the name that the user gave
    counts, corners : (f,) and (sum of counts,) int
        How many corners each polygon has, and the corners of all.
    rest : (n, 3) [m]
        Without stress, of a body; at the start, of an obstacle.
    at : step -> (n, 3) [m]
    moves : whether any position changes
    colour : sRGB, as in `pdvol.studio.shown`
    opacity : above 0 and at most 1
    closed : whether it encloses a volume, so that its inside is never seen
    body : its number among the bodies; None of an obstacle
    vertices : (n,) of the level, of a body; None of an obstacle or a render mesh
    render : of a body, the render mesh that this is; its `uvs` have a place for each of `uv_corners`
    """

    name: str
    label: str
    counts: np.ndarray
    corners: np.ndarray
    rest: np.ndarray
    at: Callable[[int], np.ndarray]
    moves: bool
    colour: str
    opacity: float = 1.0
    closed: bool = True
    body: int | None = None
    vertices: np.ndarray | None = None
    render: StoredRender | None = None


def body_parts(run: Run, level: RunLevel, surface: str = RENDER) -> list[Part]:
    """The bodies of a level in their order, in the colours of pictures, and behind them their render meshes.

    Of `surface`, "render" leaves out the simulated surface of bodies that carry a render mesh, "contact" leaves out the
    render meshes, and "both" has all.
    """
    labels = [str(name) for name in run.info.get("bodies", [])]
    carried = run.render_meshes if surface != CONTACT_SURFACE else ()
    covered = {mesh.body for mesh in carried} if surface == RENDER else set()
    bodies = [_body(level, i, name, labels[i]) for i, name in enumerate(plain_names(labels)) if i not in covered]
    obstacles = [str(obstacle.name) for obstacle in run.obstacles]
    names = plain_names([*labels, *obstacles, *(f"{labels[mesh.body]}_render" for mesh in carried)])
    taken = len(labels) + len(obstacles)
    return [*bodies, *(_render(level, *named) for named in zip(names[taken:], carried, strict=True))]


def _render(level: RunLevel, name: str, mesh: StoredRender) -> Part:
    weights = level.render_weights(mesh)
    return Part(
        name,
        f"{mesh.name}, render mesh",
        mesh.counts,
        mesh.corners,
        mesh.points,
        lambda step: weights @ level.positions(step),
        True,
        PALETTE[mesh.body % len(PALETTE)],
        closed=is_closed(mesh.welded),
        body=mesh.body,
        render=mesh,
    )


def _body(level: RunLevel, i: int, name: str, label: str) -> Part:
    facets = level.surface if level.rest.shape[1] == 3 else level.cells
    mine, corners = np.unique(facets[level.mesh.point_bodies[facets[:, 0]] == i], return_inverse=True)
    return Part(
        name,
        label,
        np.full(corners.size // 3, 3),
        corners.ravel(),
        in_3d(level.rest[mine]),
        lambda step: in_3d(level.positions(step)[mine]),
        True,
        PALETTE[i % len(PALETTE)],
        closed=level.rest.shape[1] == 3,
        body=i,
        vertices=mine,
    )


def obstacle_parts(run: Run, level: RunLevel) -> list[Part]:
    """The obstacles of a level in their order; of those that contact held back, their true places."""
    taken = [str(name) for name in run.info.get("bodies", [])]
    names = plain_names([*taken, *(str(obstacle.name) for obstacle in run.obstacles)])[len(taken) :]
    low, high = _passed_box(level)
    middle, size = in_3d((low + high)[None] / 2)[0], float(np.linalg.norm(high - low)) or 1.0
    return [_obstacle(run, level, i, name, middle, size) for i, name in enumerate(names)]


def _obstacle(run: Run, level: RunLevel, i: int, name: str, middle: np.ndarray, size: float) -> Part:
    obstacle = run.obstacles[i]

    def placed(step: int) -> DrawnObstacle:
        return level.placed(run.obstacles, step)[i]

    if obstacle.kind == "plane":
        moves = obstacle.arrays["point"].ndim == 2 or obstacle.arrays["normal"].ndim == 2
        along = across(obstacle.plane(0)[1])
        reach = PLANE_REACH * size
        at = lambda step: plane_piece(*placed(step).plane(step), middle, along, reach)
        faces: Faces = [[0, 1, 2, 3]]
    else:
        moves = "positions" in obstacle.arrays
        shape = _mesh_faces if obstacle.kind == "mesh" else _polyline_faces
        faces, corners = shape(obstacle.arrays, OUTLINE_WIDTH * size)
        at = lambda step: corners(in_3d(placed(step).vertices(step)))
    return Part(
        name,
        str(obstacle.name),
        np.array([len(face) for face in faces], dtype=np.int64),
        np.concatenate([np.asarray(face, dtype=np.int64) for face in faces]) if len(faces) else np.zeros(0, np.int64),
        at(0),
        at,
        moves,
        GROUND if obstacle.kind == "plane" else OBSTACLE,
        float(obstacle.arrays.get("opacity", 1.0)),
        closed=False,
    )


def _mesh_faces(arrays: dict[str, np.ndarray], width: float) -> tuple[Faces, Corners]:
    return arrays["faces"], lambda vertices: vertices


def _polyline_faces(arrays: dict[str, np.ndarray], width: float) -> tuple[Faces, Corners]:
    """Filled loops; where there are none, a thin quad for each edge."""
    edges = arrays["edges"]
    loops = closed_loops(edges)
    if loops:
        return loops, lambda vertices: vertices

    def ribbon(vertices: np.ndarray) -> np.ndarray:
        a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
        side = np.cross(b - a, [0.0, 0.0, 1.0])
        side *= 0.5 * width / np.maximum(np.linalg.norm(side, axis=1, keepdims=True), np.finfo(float).tiny)
        return np.stack([a + side, b + side, b - side, a - side], axis=1).reshape(-1, 3)

    return np.arange(4 * len(edges)).reshape(-1, 4), ribbon


def _passed_box(level: RunLevel) -> tuple[np.ndarray, np.ndarray]:
    """The lowest and highest coordinates (d,) [m] of a level's states; of some of them where there are many."""
    last = level.steps - 1
    states = [level.positions(step) for step in np.unique(np.linspace(0, last, BOX_STATES).round().astype(int))]
    return np.min([x.min(axis=0) for x in states], axis=0), np.max([x.max(axis=0) for x in states], axis=0)


def plain_names(names: Sequence[str]) -> list[str]:
    """Names of letters, digits and underscores in the same order, no two alike; they begin with no digit."""
    result: list[str] = []
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", str(name))[:LONGEST_NAME] or "body"
        plain = plain if plain[0].isalpha() or plain[0] == "_" else f"_{plain}"
        free, number = plain, 0
        while free in result:
            number += 1
            free = f"{plain}_{number}"
        result.append(free)
    return result
