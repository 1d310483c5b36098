"""Where a scene's obstacles are, as pictures and stored runs need them."""

import numpy as np

from pdvol.errors import InputError
from pdvol.scene import Plane, Rigid, Scene, Still, moved

MOST_PLACES = 20_000_000  # of vertices of moving obstacles, for pictures: half a GB


def drawn_obstacles(scene: Scene, geometry) -> list[dict]:
    """Obstacles as pictures need them, with their places over time where they move."""
    moving = sum(
        len(vertices)
        for (vertices, *_), o in zip(geometry, (o for o in scene.obstacles if isinstance(o, Rigid)), strict=True)
        if not isinstance(o.motion, Still)
    )
    if moving * (scene.steps + 1) > MOST_PLACES:
        raise InputError(
            f"{moving:,} vertices of moving obstacles over {scene.steps:,} steps are too many to keep; simulate fewer"
            " steps at a time"
        )
    places = [moving_places(scene, geometry, number * scene.dt) for number in range(scene.steps + 1)]
    drawn, rigid = [], iter(geometry)
    for i, obstacle in enumerate(scene.obstacles):
        if isinstance(obstacle, Plane):
            start = {
                "point": np.asarray(obstacle.point, dtype=float),
                "normal": np.asarray(obstacle.normal, dtype=float),
            }
            moving = {key: np.array([place[i][key] for place in places]) for key in start if i in places[0]}
            drawn.append({"name": obstacle.name, "kind": "plane", **start, **moving})
            continue
        vertices, edges, faces = next(rigid)
        shape = {"kind": "mesh", "faces": faces} if vertices.shape[1] == 3 else {"kind": "polyline", "edges": edges}
        positions = {"positions": np.array([place[i]["vertices"] for place in places])} if i in places[0] else {}
        look = {"opacity": obstacle.opacity} if obstacle.opacity < 1.0 else {}
        drawn.append({"name": obstacle.name, "vertices": vertices, **shape, **positions, **look})
    return drawn


def moving_places(scene: Scene, geometry, time: float) -> dict[int, dict[str, np.ndarray]]:
    """Where the obstacles that move are at `time` [s], by their number."""
    found, rigid = {}, iter(geometry)
    for i, obstacle in enumerate(scene.obstacles):
        plane = isinstance(obstacle, Plane)
        corners = (
            np.array([obstacle.point, np.add(obstacle.point, obstacle.normal)], dtype=float)
            if plane
            else next(rigid)[0]
        )
        if isinstance(obstacle.motion, Still):
            continue
        x = moved(obstacle.motion, corners, time, f"{'plane' if plane else 'obstacle'} {obstacle.name!r}")
        found[i] = {"point": x[0], "normal": x[1] - x[0]} if plane else {"vertices": x}
    return found
