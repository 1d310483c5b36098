"""Renders levels of 2D scenes with Pillow alone: loading VTK takes longer than level 0 of such a scene."""

from typing import Self

import numpy as np
from PIL import Image, ImageDraw

from pdvol.geometry.crossings import edges_of
from pdvol.store.reader import Run, RunLevel
from pdvol.store.series import in_3d
from pdvol.studio.draw.camera import Camera
from pdvol.studio.draw.layout import BACKGROUND, darker, rgb
from pdvol.studio.shown import GROUND, OBSTACLE, PALETTE, closed_loops, plane_piece

SAMPLES_ACROSS = 2  # along each side of a pixel of what is scaled down: 16 samples a pixel with an oversampling of two


class FlatRenderer:
    """Renders levels of 2D runs.

    Parameters
    ----------
    camera : of pictures that name no other one
    size : (width, height) of a picture [pixels]
    oversampling : pixels rendered for each pixel of a picture, along each side: smooth edges
    """

    def __init__(self, camera: Camera, size: tuple[int, int], oversampling: int = 2):
        self.camera, self.size, self._scale = camera, size, SAMPLES_ACROSS * oversampling

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is open."""

    def picture(
        self, run: Run, level: RunLevel, step: int, camera: Camera | None = None, colours: np.ndarray | None = None
    ) -> Image.Image:
        """One level of a run at one step, seen by a camera of the renderer's aspect. Cells have their bodies' colours,
        whatever `colours` are.
        """
        view, positions = camera or self.camera, in_3d(level.positions(step))
        canvas = _Canvas(view, self.size, self._scale)
        coarseness = float(np.clip(14.0 / np.sqrt(len(level.cells)), 0.2, 1.0))
        outlines = []
        for obstacle in sorted(level.placed(run.obstacles, step), key=lambda obstacle: obstacle.kind != "plane"):
            if obstacle.kind == "plane":
                point, normal = obstacle.plane(step)
                corners = plane_piece(point, normal, view.focus, normal, 4 * view.size)
                canvas.fill(corners, np.arange(4)[None], rgb(GROUND))
                outlines.append((corners, np.array([[0, 3]]), darker(rgb(GROUND), 0.7), 2.0))
            elif obstacle.kind == "polyline":
                vertices, edges = in_3d(obstacle.vertices(step)), obstacle.arrays["edges"]
                canvas.fill(vertices, closed_loops(edges), rgb(OBSTACLE))
                outlines.append((vertices, edges, darker(rgb(OBSTACLE), 0.55), 2.5))
        for body in np.unique(level.bodies):
            colour, mine = rgb(PALETTE[body % len(PALETTE)]), level.cells[level.bodies == body]
            canvas.fill(positions, mine, colour)
            canvas.lines(positions, edges_of(mine), darker(colour, 0.8 - 0.2 * coarseness), 0.5 + 0.7 * coarseness)
        for body in np.unique(level.bodies):
            outline = level.surface[level.mesh.point_bodies[level.surface[:, 0]] == body]
            canvas.lines(positions, outline, darker(rgb(PALETTE[body % len(PALETTE)]), 0.5), 2.0)
        for outline in outlines:
            canvas.lines(*outline)
        return canvas.image()


class _Canvas:
    """What is drawn last lies above the rest. Points are (n, 3) [m]."""

    def __init__(self, view: Camera, size: tuple[int, int], scale: int):
        self._size, self._scale = size, scale
        width, height = scale * size[0], scale * size[1]
        self._image = Image.new("RGB", (width, height), BACKGROUND)
        self._draw = ImageDraw.Draw(self._image)
        pixels = height / (2 * view.half_height)  # of a metre
        self._axes = pixels * np.column_stack([view.right, -view.up])
        self._middle = np.array([width, height]) / 2 - view.focus @ self._axes

    def fill(self, points: np.ndarray, polygons: "np.ndarray | list[list[int]]", ink: tuple[int, int, int]) -> None:
        """Polygons of these corners."""
        places = points @ self._axes + self._middle
        for polygon in polygons:
            self._draw.polygon(places[polygon].ravel().tolist(), ink)

    def lines(self, points: np.ndarray, segments: np.ndarray, ink: tuple[int, int, int], width: float) -> None:
        """Straight lines, `width` pixels of the picture wide."""
        thickness = max(1, round(self._scale * width))
        for ends in (points @ self._axes + self._middle)[segments].reshape(-1, 4).tolist():
            self._draw.line(ends, ink, thickness)

    def image(self) -> Image.Image:
        """The picture in its size."""
        return self._image.reduce(SAMPLES_ACROSS).resize(self._size, Image.Resampling.LANCZOS)
