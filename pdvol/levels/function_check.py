"""Every function of a scene called once before anything is meshed: a mistake in one costs no minutes of meshing.

Functions are called at the points of the bodies' shapes. What they give there is checked by its shape alone: values are
checked on the levels, where they are used.
"""

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from pdvol.levels.scene_fields import check_load_in_time, motion_times, support_label
from pdvol.levels.script import Obstacle
from pdvol.meshes import Outline
from pdvol.meshing.readers import read_shape
from pdvol.scene import Body, Flow, Keyed, PointCache, Scene, moved
from pdvol.scene.checks import called, chosen, fits

SCALARS, VECTORS, EITHER = (1,), (2,), (1, 2)
"""Of functions of points (n, d): whether they give (n,) or (n, d), by the number of axes."""


def call_functions(scene: Scene, obstacles: Sequence[Obstacle]) -> None:
    """InputError, naming it, where a function of a scene fails or gives an array of another shape. Serial."""
    points: dict[str, np.ndarray] = {}

    def of(name: str) -> np.ndarray:
        """(n, d) [m] points of a body's shape, as placed, of all bodies without a name; read where they are needed."""
        for body in scene.bodies:
            if body.name not in points and name in ("", body.name):
                points[body.name] = body.placement(shape_points(body))
        return np.vstack([points[body.name] for body in scene.bodies if name in ("", body.name)])

    with np.errstate(all="ignore"):
        for name, function, body_name, gives in _of_places(scene):
            if callable(function) and not isinstance(function, Keyed):
                X = of(body_name)
                called(name, function, (X.copy(),), *(X.shape[:n] for n in gives))
        for muscle in scene.muscles:
            if callable(muscle.activation):
                X = of(muscle.body)
                both = fits(muscle.activation, 2)
                arguments, shape = ((0.0, X.copy()), X.shape[:1]) if both else ((0.0,), ())
                called("Muscle.activation", muscle.activation, arguments, shape)
        for load in scene.loads:
            if any(callable(getattr(load, field.name)) for field in fields(load)):
                X = of(load.body if isinstance(load, Flow) else scene.bodies[0].name)
                check_load_in_time(scene, load, X)
        for support in scene.supports:
            if not isinstance(support.motion, PointCache):
                X = of(support.body)
                held = X[chosen("a support's `where`", support.where, X)]
                for time in motion_times(scene, support) if len(held) else ():
                    moved(support.motion, held, time, support_label(support, 0))
        for obstacle in obstacles:
            for time in motion_times(scene) if obstacle.moves else ():
                obstacle.at(time)


def shape_points(body: Body) -> np.ndarray:
    """Points (n, d) of a body's shape, of the coarsest level's where each has its own."""
    shape = read_shape(body.shape[0] if isinstance(body.shape, (tuple, list)) else body.shape)
    return np.asarray(shape.points if isinstance(shape, Outline) else shape.vertices, dtype=float)


def _of_places(scene: Scene) -> Iterator[tuple[str, Any, str, tuple]]:
    """What may be a function of rest positions alone: its name, the value, the body, and what a function gives."""
    for body in scene.bodies:
        yield f"the start of body {body.name!r}", body.start, body.name, VECTORS
        yield f"body {body.name!r}: velocity", body.velocity, body.name, VECTORS
        for material in (body.material, *(region.material for region in body.regions)):
            own = material.own_parameters()
            for name in (field.name for field in fields(material)):
                gives = EITHER if name in own else SCALARS
                yield f"{type(material).__name__}.{name}", getattr(material, name), body.name, gives
        for region in body.regions:
            yield "Region.where", region.where, body.name, SCALARS
    for load in scene.loads:
        yield f"a {type(load).__name__.lower()}'s `where`", getattr(load, "where", None), "", SCALARS
    for muscle in scene.muscles:
        yield "Muscle.where", muscle.where, muscle.body, SCALARS
        yield "Muscle.fibre", muscle.fibre, muscle.body, VECTORS
    for attachment in scene.attachments:
        yield "Attachment.where", attachment.where, attachment.body, SCALARS
        yield "Attachment.to", attachment.to, attachment.other, SCALARS
