"""Surfaces of stored states, as arrays: what a page draws. Nothing here knows a web library."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pdvol.geometry.crossings import edges_of
from pdvol.meshing.polygons import cut_faces
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run
from pdvol.store.series import in_3d
from pdvol.studio.draw.camera import Camera, content_of_run, fitted_camera
from pdvol.studio.draw.layout import darker, rgb
from pdvol.studio.shown import GROUND, OBSTACLE, PALETTE, SMOOTH_FROM, across, closed_loops, plane_piece, upward_in_3d

SURROUNDINGS = 1.5  # diagonals of the bodies within which large obstacles count for the camera
SCENE_SIZE = 5.0  # diagonals of the bodies: an obstacle within this of them is shown whole, since the shot goes there
PLANE_SIZE = 4.0  # half the side of the square that stands for a plane, over the size of the content
LAYER = 0.002  # between drawings of a 2D scene that lie over each other, over the size of the content

SQUARE = np.array([[0, 1, 2], [0, 2, 3]])


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles or lines of one colour.

    Attributes
    ----------
    name : unique in its frame; the same shape has the same name in the next frame
    points : (n, 3) float32 [m]
    faces : (m, 3) int triangles, or (m, 2) lines
    colour : red, green and blue, 0 to 255
    smooth : whether facets are shaded as a smooth surface
    opacity : 0 to 1
    lit : whether it is shaded; drawings of 2D scenes are not
    body : whether it is the surface of a body, which may be drawn as a wireframe
    """

    name: str
    points: np.ndarray
    faces: np.ndarray
    colour: tuple[int, int, int]
    smooth: bool = False
    opacity: float = 1.0
    lit: bool = True
    body: bool = False


class Frames:
    """The frames of one level of a run.

    Parameters
    ----------
    run : may still be written
    level : its index
    size : of the content [m], `Camera.size`
    middle : (3,) [m], around which planes are drawn
    """

    def __init__(self, run: Run, level: int, size: float, middle: np.ndarray):
        self.run, self.level = run, run.levels[level]
        self._size, self._middle = size, middle
        mesh, surface = self.level.mesh, self.level.surface
        owners = mesh.point_bodies[surface[:, 0]]
        self._flat = mesh.dim == 2
        self._parts: list[tuple[int, np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
        for body in np.unique(mesh.bodies):
            outline = surface[owners == body]
            facets = mesh.cells[mesh.bodies == body] if self._flat else outline
            used, local = np.unique(facets, return_inverse=True)
            faces = local.reshape(facets.shape)
            edges = edges_of(faces) if self._flat else np.empty((0, 2), dtype=int)
            self._parts.append((int(body), used, faces, edges, outline))
        self._filled = [_cut(obstacle) for obstacle in run.obstacles]

    def at(self, step: int) -> list[Shape]:
        """The bodies and the obstacles at a stored step; raises as `RunLevel.positions`."""
        points, shapes = in_3d(self.level.positions(step)), []
        for body, used, faces, edges, outline in self._parts:
            colour, name, drawn = rgb(PALETTE[body % len(PALETTE)]), f"body {body}", points[used].astype(np.float32)
            if self._flat:
                shapes.append(Shape(name, drawn, faces, colour, lit=False, body=True))
                inner = _shifted(points[used], LAYER * self._size)
                shapes.append(Shape(f"{name} cells", inner, edges, darker(colour, 0.7), lit=False))
                shapes.append(_line(f"{name} outline", points, outline, darker(colour, 0.45), 2 * LAYER * self._size))
            else:
                shapes.append(Shape(name, drawn, faces, colour, smooth=len(faces) >= SMOOTH_FROM, body=True))
        for number, obstacle in enumerate(self.level.placed(self.run.obstacles, step)):
            shapes += self._obstacle(number, obstacle, step)
        return shapes

    def _obstacle(self, number: int, obstacle: DrawnObstacle, step: int) -> list[Shape]:
        name, size = f"obstacle {number}", self._size
        if obstacle.kind == "plane":
            point, normal = obstacle.plane(step)
            corners = plane_piece(point, normal, self._middle, across(normal), PLANE_SIZE * size)
            if not self._flat:
                return [Shape(name, corners.astype(np.float32), SQUARE, rgb(GROUND))]
            edge = _line(f"{name} edge", corners, np.array([[0, 3]]), darker(rgb(GROUND), 0.7), 0.0)
            return [Shape(name, _shifted(corners, -2 * LAYER * size), SQUARE, rgb(GROUND), lit=False), edge]
        if obstacle.kind == "mesh":
            points, faces = obstacle.vertices(step).astype(np.float32), obstacle.arrays["faces"]
            opacity = float(obstacle.arrays.get("opacity", 1.0))
            return [Shape(name, points, faces, rgb(OBSTACLE), len(faces) >= SMOOTH_FROM, opacity)]
        points, edges = in_3d(obstacle.vertices(step)), obstacle.arrays["edges"]
        shapes = [_line(f"{name} outline", points, edges, darker(rgb(OBSTACLE), 0.55), 0.0)]
        if len(self._filled[number]):
            drawn = _shifted(points, -LAYER * size)
            shapes.append(Shape(name, drawn, self._filled[number], rgb(OBSTACLE), lit=False))
        return shapes


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


def _cut(obstacle: DrawnObstacle) -> np.ndarray:
    """(m, 3) triangles that fill a polyline's closed chains; none where they cannot be cut, and for other kinds."""
    if obstacle.kind != "polyline":
        return np.empty((0, 3), dtype=int)
    try:
        return cut_faces(obstacle.vertices(0), closed_loops(obstacle.arrays["edges"]))
    except ValueError:  # a long outline that is not convex: its line is drawn
        return np.empty((0, 3), dtype=int)


def _line(name: str, points: np.ndarray, segments: np.ndarray, colour: tuple[int, int, int], raised: float) -> Shape:
    used, local = np.unique(segments, return_inverse=True)
    return Shape(name, _shifted(points[used], raised), local.reshape(segments.shape), colour, lit=False)


def _shifted(points: np.ndarray, height: float) -> np.ndarray:
    return (points + [0.0, 0.0, height]).astype(np.float32)


def same_topology(one: Sequence[Shape], other: Sequence[Shape]) -> bool:
    """Whether two frames differ in positions only."""
    return len(one) == len(other) and all(
        a.name == b.name and a.colour == b.colour and np.array_equal(a.faces, b.faces)
        for a, b in zip(one, other, strict=True)
    )
