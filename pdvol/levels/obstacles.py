"""A scene's obstacles in metres: half-spaces, surfaces and polylines read and placed, and stored over time."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pdvol.errors import InputError
from pdvol.levels.script import ON_TIME, HeldPoints, Mover, Obstacle
from pdvol.scene import Deforming, Led, Motion, Obstructing, Plane, PointCache, Rigid, Still, stands

Geometry = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Vertices (k, d) [m], edges (e, 2) and faces (f, 3) of a surface or polyline at rest."""

COMPARED = (0.31, 0.73, 1.0)  # fractions of a scene's duration at which motions are compared: no period divides all
MOST_STORED_VERTICES = 20_000_000  # vertices times states of moving obstacles: stored places take half a GB


def motion_of(motion: Motion | PointCache, vertices: np.ndarray, whose: str) -> Motion:
    """The motion of vertices (n, d) at rest [m]; those that a point cache moves are matched to its first frame.

    Raises
    ------
    InputError
        As `pdvol.levels.animated.cached_motion`, which names the vertices by `whose`.
    """
    if not isinstance(motion, PointCache):
        return motion
    from pdvol.levels.animated import cached_motion  # loads libigl and SciPy's transforms, which few scenes need

    return cached_motion(motion, vertices, whose)


def read_geometry(obstacles: Sequence[Obstructing]) -> list[Geometry]:
    """The geometry of each obstacle but planes, in order; arrays, which ranks can send each other. Serial."""
    from pdvol.meshing.build import read_obstacle  # loads the meshers, which starts and summaries do without

    return [read_obstacle(o) for o in obstacles if isinstance(o, Rigid | Deforming)]


def placed_obstacles(
    obstacles: Sequence[Obstructing], geometry: Sequence[Geometry] | None = None
) -> tuple[Obstacle, ...]:
    """The obstacles of a scene with their geometry, in its order. Serial.

    Parameters
    ----------
    geometry : of each obstacle but planes, in order; read from their shapes where not given

    Raises
    ------
    InputError
        A shape, a point cache or a motion cannot be read or does not fit.
    """
    remaining = iter(read_geometry(obstacles) if geometry is None else geometry)
    placed = tuple(plane_obstacle(o) if isinstance(o, Plane) else _with_mesh(o, next(remaining)) for o in obstacles)
    for obstacle in placed:
        obstacle.at(0.0)
    return placed


def plane_obstacle(plane: Plane) -> Obstacle:
    """A half-space of a scene."""
    point, normal = np.asarray(plane.point, dtype=float), np.asarray(plane.normal, dtype=float)
    axes, _ = np.linalg.qr(np.column_stack([normal, np.eye(len(normal))]))  # the first is the normal, or against it
    axes[:, 0] = normal / np.linalg.norm(normal)
    frame = np.vstack([point, point + axes.T])
    nothing = np.zeros((0, 2), dtype=np.int64), np.zeros((0, 3), dtype=np.int64)
    return Obstacle(plane.name, "plane", frame, *nothing, motion=plane.motion)


def _with_mesh(given: Rigid | Deforming, geometry: Geometry) -> Obstacle:
    vertices, edges, faces = geometry
    kind = "mesh" if vertices.shape[1] == 3 else "polyline"
    motion = motion_of(given.motion, vertices, f"obstacle {given.name!r}")
    return Obstacle(given.name, kind, vertices, edges, faces, motion, given.closed, given.opacity)


def ground_of(movers: Sequence[Mover], duration: float) -> tuple[Obstacle, ...]:
    """The plane in whose frame motions wait that contact holds back, as the floor of a lift; none in most scenes, where
    they wait in the scene's frame.

    It is a plane that the most supports and obstacles go along with over the `duration` [s], where nothing stands still
    and no others are as many. So a scene that is seen from a frame that moves evenly gives the same motion.
    """
    own = [replace(m, motion=m.motion.own) if isinstance(m.motion, Led) else m for m in movers]
    planes = [mover for mover in movers if isinstance(mover, Obstacle) and mover.kind == "plane"]
    if not planes or any(_goes_along(m, Still(), duration) for m in own):
        return ()
    groups: list[tuple[int, Obstacle]] = []
    for plane in planes:
        motion = lambda X, t, pose=plane.pose: (pose(t) @ pose(0.0).inverse)(X)
        if not any(_goes_along(first, motion, duration) for _, first in groups):
            groups.append((sum(_goes_along(m, motion, duration) for m in own), plane))
    most = max(size for size, _ in groups)
    largest = tuple(plane for size, plane in groups if size == most)
    return largest if len(largest) == 1 else ()


def _goes_along(mover: Mover, motion: Motion, duration: float) -> bool:
    """Whether a motion takes all points of a mover from where its own motion begins to where they are later; those of a
    support while it holds.
    """
    begun, until = mover.at(0.0), duration
    if isinstance(mover, HeldPoints):
        begun, until = np.asarray(mover.motion(mover.points, 0.0)), min(duration, mover.release)
    for time in (fraction * until for fraction in COMPARED):
        there = motion(begun, time)
        if np.abs(mover.at(time) - there).max() > ON_TIME * max(1.0, float(np.abs(there).max())):
            return False
    return True


def stored_obstacles(obstacles: Sequence[Obstacle], dt: float, steps: int) -> list[dict]:
    """Obstacles as `store.obstacles.write_obstacles` takes them, with their places at all steps where they move.

    Raises
    ------
    InputError
        Moving obstacles have too many vertices for so many steps.
    """
    moving = sum(len(o.vertices) for o in obstacles if not stands(o.motion) and o.kind != "plane")
    if moving * (steps + 1) > MOST_STORED_VERTICES:
        raise InputError(
            f"{moving:,} vertices of moving obstacles over {steps:,} steps are too many to keep;"
            " simulate fewer steps at a time"
        )
    return [_stored(obstacle, dt, steps) for obstacle in obstacles]


def _stored(obstacle: Obstacle, dt: float, steps: int) -> dict:
    scripted = replace(obstacle, motion=obstacle.motion.own) if isinstance(obstacle.motion, Led) else obstacle
    numbers = range(steps + 1 if scripted.moves else 1) if obstacle.moves else ()  # readers add what a hand has shifted
    places = [scripted.stored(scripted.place(number * dt)) for number in numbers]
    over_time = {key: np.array([place[key] for place in places]) for key in (places[0] if places else ())}
    entry: dict = {"name": obstacle.name, "kind": obstacle.kind}
    if obstacle.kind == "plane":
        return {**entry, **obstacle.stored(obstacle.pose(0.0)), **over_time}
    cells = {"faces": obstacle.faces} if obstacle.kind == "mesh" else {"edges": obstacle.edges}
    positions = {"positions": over_time["vertices"]} if places else {}
    opacity = {"opacity": obstacle.opacity} if obstacle.opacity < 1.0 else {}
    return {**entry, "vertices": obstacle.vertices, **cells, **positions, **opacity}
