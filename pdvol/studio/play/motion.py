"""What moves: the drawn vertices of a level, and obstacles, at all stored states, as whole numbers of 16 bits."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import RunLevel
from pdvol.studio.play.packing import LARGEST, Chunks, quantised
from pdvol.studio.shown import closed_loops

FLOAT_ROUNDING = 2.0**-22  # relative error of positions that a graphics card computes in single precision


class Skin:
    """The drawn part of a level: its boundary in 3D, all of it in 2D.

    Attributes
    ----------
    vertices : (k,) int64
        Of the level, ascending: the input's order.
    faces : (f, 3) int64
        Into `vertices`.
    bodies : (k,) int32
        The body of each vertex.
    """

    def __init__(self, level: RunLevel):
        facets = level.surface if level.rest.shape[1] == 3 else level.cells
        self.vertices, faces = np.unique(facets, return_inverse=True)
        self.faces = faces.reshape(facets.shape)
        self.bodies = level.mesh.point_bodies[self.vertices]


def packed_skin(level: RunLevel, steps: Sequence[int], chunks: Chunks, covered: Sequence[int] = ()) -> dict:
    """A level's drawn vertices at some steps: `low` and `span` [m] of their box, `positions` in `chunks`, `error` [m],
    a bound for what the browser shows of a coordinate, and what `packed_faces` gives.
    """
    skin = Skin(level)
    found = packed_states(lambda step: level.positions(step)[skin.vertices], steps, chunks)
    return found | packed_faces(level, skin, chunks, covered)


def packed_faces(level: RunLevel, skin: Skin, chunks: Chunks, covered: Sequence[int] = ()) -> dict:
    """`faces`, `bodies` and, in 2D, `outline` of a level's drawn part in `chunks`. Faces of the bodies in `covered`
    come last; `uncovered` is the number of the others.
    """
    last = np.isin(skin.bodies[skin.faces[:, 0]], covered)
    faces = skin.faces[np.argsort(last, kind="stable")]
    found = {"faces": chunks.raw(faces.astype(np.uint32)), "bodies": chunks.raw(skin.bodies.astype(np.uint16))}
    found["uncovered"] = int(np.count_nonzero(~last))
    if level.rest.shape[1] == 2:
        outline = np.searchsorted(skin.vertices, level.surface)
        found["outline"] = chunks.raw(outline.astype(np.uint32))
    return found


def packed_states(positions: Callable[[int], np.ndarray], steps: Sequence[int], chunks: Chunks) -> dict:
    """`low` and `span` [m] of the box of positions (n, d) at all steps, these as whole numbers `positions` in
    `chunks`, and `error` [m], a bound for a coordinate. States are read one by one, twice.
    """
    low, high = (np.full(positions(steps[0]).shape[1], sign * np.inf) for sign in (1, -1))
    for step in steps:
        x = positions(step)
        low, high = np.minimum(low, x.min(axis=0)), np.maximum(high, x.max(axis=0))
    values = np.stack([quantised(positions(step), low, high - low) for step in steps])
    largest = LARGEST[values.dtype]
    error = float((high - low).max() / largest / 2 + FLOAT_ROUNDING * np.maximum(abs(low), abs(high)).max())
    return {"low": low, "span": high - low, "error": error, "positions": chunks.states(values)}


def packed_obstacles(
    level: RunLevel, obstacles: Sequence[DrawnObstacle], steps: Sequence[int], chunks: Chunks
) -> list[dict]:
    """A run's obstacles as they were at some of a level's steps: one state of those that rest, all of others."""
    placed = {step: level.placed(obstacles, step) for step in steps}
    return [_packed_obstacle({step: at[i] for step, at in placed.items()}, chunks) for i in range(len(obstacles))]


def _packed_obstacle(at: Mapping[int, DrawnObstacle], chunks: Chunks) -> dict:
    steps = list(at)
    obstacle, first = at[steps[0]], steps[0]
    if obstacle.kind == "plane":
        places = [np.concatenate(o.plane(step)) for step, o in at.items()]
        rests = all(np.array_equal(place, places[0]) for place in places)
        return packed_shape(obstacle, chunks) | {"places": places[:1] if rests else places}
    rests = all(np.array_equal(o.vertices(step), obstacle.vertices(first)) for step, o in at.items())
    states = packed_states(lambda step: at[step].vertices(step), steps[:1] if rests else steps, chunks)
    return packed_shape(obstacle, chunks) | states


def packed_shape(obstacle: DrawnObstacle, chunks: Chunks) -> dict:
    """An obstacle without its places: `kind` and `name`, and what lies between its vertices."""
    found = {"kind": obstacle.kind, "name": obstacle.name}
    if obstacle.kind == "plane":
        return found
    if obstacle.kind == "mesh":
        opacity = float(obstacle.arrays.get("opacity", 1.0))
        return found | {"faces": chunks.raw(obstacle.arrays["faces"].astype(np.uint32)), "opacity": opacity}
    edges = obstacle.arrays["edges"]
    return found | {"edges": chunks.raw(edges.astype(np.uint32)), "loops": closed_loops(edges)}
