"""Shapes in a viser scene: made once, then moved."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pdvol.studio.draw.camera import VIEW_ANGLE, Camera
from pdvol.studio.draw.layout import BACKGROUND, rgb
from pdvol.studio.live.frames import Shape, same_topology

LINE_WIDTH = 1.5  # pixels
FLAT_LIGHT = 3.14  # of an ambient light that gives a surface its own colour: three.js divides by pi


class Stage:
    """Shows one frame after the other.

    Parameters
    ----------
    server : viser's
    """

    def __init__(self, server: Any):
        self._server = server
        self._shown: list[Shape] = []
        self._handles: dict[str, Any] = {}
        server.scene.set_background_image(np.full((1, 1, 3), rgb(BACKGROUND), np.uint8), format="png")
        server.scene.world_axes.visible = False
        server.scene.configure_environment_map(None)  # its filters hold a page without a GPU up for half a minute
        self._flat: bool | None = None
        self._wireframe = False

    def show(self, shapes: Sequence[Shape]) -> None:
        """Put this frame in place of the one before."""
        with self._server.atomic():
            self._light(not any(shape.lit for shape in shapes))
            if not same_topology(self._shown, shapes):
                kept = {shape.name for shape in shapes}
                for name in [name for name in self._handles if name not in kept]:
                    self._handles.pop(name).remove()
                for shape in shapes:
                    self._handles[shape.name] = self._add(shape)
            else:
                for before, shape in zip(self._shown, shapes, strict=True):
                    if not np.array_equal(before.points, shape.points):
                        self._move(shape)
        self._shown = list(shapes)

    def draw_wireframe(self, wireframe: bool) -> None:
        """Show the edges of the bodies' facets alone, or the facets."""
        self._wireframe = wireframe
        for shape in self._shown:
            if shape.body:
                self._handles[shape.name].wireframe = wireframe

    def look_from(self, camera: Camera, up: np.ndarray) -> None:
        """Turn the cameras of all pages, and of those that open later, to this view."""
        start = self._server.initial_camera
        self._server.scene.set_up_direction(tuple(up))
        for one in (start, *(client.camera for client in self._server.get_clients().values())):
            one.fov = float(np.radians(VIEW_ANGLE))
            one.position = tuple(camera.focus + max(1.0, camera.aspect) * camera.distance * camera.towards)  # a window
            one.look_at = tuple(camera.focus)  # may be as high as it is wide
            if one is not start:
                one.up_direction = tuple(up)
            one.near, one.far = 0.02 * camera.distance, camera.distance + 20 * camera.size

    def _light(self, flat: bool) -> None:
        """A light from everywhere for drawings, which shows their colours as they are; lamps too for solids."""
        if flat != self._flat:
            self._flat = flat
            self._server.scene.configure_default_lights(enabled=not flat, cast_shadow=False)
            self._server.scene.add_light_ambient("/light", intensity=FLAT_LIGHT if flat else 0.3 * FLAT_LIGHT)

    def _add(self, shape: Shape) -> Any:
        scene, name = self._server.scene, f"/{shape.name}"
        if shape.faces.shape[1] == 2:
            return scene.add_line_segments(
                name, shape.points[shape.faces], shape.colour, thickness=LINE_WIDTH, thickness_units="screen"
            )
        return scene.add_mesh_simple(
            name,
            shape.points,
            shape.faces,
            color=shape.colour,
            wireframe=self._wireframe and shape.body,
            flat_shading=not shape.smooth,
            opacity=None if shape.opacity >= 1.0 else shape.opacity,
            side="double",
            cast_shadow=False,  # a shadow map leaves stripes on a large ground, and takes most of a frame's time
            receive_shadow=False,
        )

    def _move(self, shape: Shape) -> None:
        handle = self._handles[shape.name]
        if shape.faces.shape[1] == 2:
            handle.points = shape.points[shape.faces]
        else:
            handle.vertices = shape.points
