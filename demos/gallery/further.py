"""The film of a binding: cells in the colour of the cell of level 0 that they are bound to (paper, figure "robust
vertex-element binding").
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from PIL import Image, ImageDraw

from demos.gallery.entries import Entry
from demos.gallery.film import FRAMES_PER_SECOND, film_frames, fit_film
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.draw.bindings import cell_colours
from pdvol.studio.draw.camera import Camera
from pdvol.studio.draw.camera_path import cameras_of_run
from pdvol.studio.draw.cut import read_cut
from pdvol.studio.draw.film import FilmFile
from pdvol.studio.draw.layout import BACKGROUND, CELL_GAP, FAINT_INK, INK, font, grid
from pdvol.studio.draw.renderer import Renderer

SIZE, HEADER = (1260, 440), 64  # pixels, of the film, and above each picture for captions
MATERIAL = {"ambient": 0.62, "diffuse": 0.58, "specular": 0.06}  # of painted bodies: light that spares their colours


@dataclass(frozen=True)
class Pane:
    """One picture of each frame: a level with the colours (m, 3) of its cells, in [0, 1]."""

    title: str
    level: RunLevel
    colours: np.ndarray


class PaintedRenderer(Renderer):
    """Draws bodies in the colours of a pane."""

    def painted(self, pane: Pane, step: int, camera: Camera) -> Image.Image:
        """The pane at a step; its last state where its level is not simulated that far."""
        self._pane, self._drawn = pane, ()  # the same level at the same step may have other colours
        return self.picture(pane.level, min(step, pane.level.steps - 1), camera)

    def draw_body(self, level: RunLevel, body: int, positions: np.ndarray, step: int) -> np.ndarray:
        """As that of `Renderer`, in the pane's colours, which a cut shows on its section as well."""
        mine = level.bodies == body
        shape: Any = pv.UnstructuredGrid({pv.CellType.TETRA: level.cells[mine]}, positions)
        shape.cell_data["colour"] = np.round(255 * self._pane.colours).astype(np.uint8)[mine]
        if self._cut is not None and self._cut.through(str(self.run.info["bodies"][body]), True):
            shape = self._cut.left(shape, self._view.towards)
        skin = shape.extract_surface(algorithm="dataset_surface").triangulate()
        if skin.n_cells:
            style = {**MATERIAL, "smooth_shading": False, "reset_camera": False, "render": False}
            self._plotter.add_mesh(skin, scalars="colour", rgb=True, **style)
        return np.asarray(skin.points, dtype=float)[skin.regular_faces]


def binding_panes(entry: Entry, run: Run) -> list[Pane]:
    """Level 0, level 1 as it is bound, and as it would be bound to the nearest cells: cells of level 1 have the colour
    of their home cell. A demo may name colours of its own by a function `colours(run)` of the cells of level 0.
    """
    from mpi4py import MPI

    from demos.recipes.closest_binding import closest_binding
    from pdvol.levels.binding import home_cells
    from pdvol.levels.hierarchy import Hierarchy
    from pdvol.runs.scene_file import load_module

    pair = Hierarchy([level.mesh for level in run.levels[:2]], MPI.COMM_SELF, run.info["prolongation"]).prolongation(1)
    coarse, fine = run.levels[:2]
    colours = getattr(load_module(entry.file), "colours", lambda run: cell_colours(np.arange(len(coarse.cells))))
    own, nearest = colours(run), closest_binding(pair.fine, pair.coarse)
    return [
        Pane("level 0", coarse, own),
        Pane("level 1, by pdvol", fine, own[home_cells(pair.fine, pair.coarse, pair.binding)]),
        Pane("level 1, nearest cells", fine, own[home_cells(pair.fine, pair.coarse, nearest)]),
    ]


def write_bound(entry: Entry, run: Run, out: Path) -> Path:
    """Write the film of how level 1 is bound to level 0, cut as the entry says."""
    panes, levels = binding_panes(entry, run), list(run.levels[:2])
    frames = film_frames(run.info["steps"], run.dt, entry.slow)
    content = cameras_of_run(run, levels, frames, run.obstacles)[0].aspect
    columns, (width, height) = grid(len(panes), SIZE, content, HEADER)
    cameras = cameras_of_run(run, levels, frames, run.obstacles, aspect=width / height)
    cut = read_cut(entry.bound, run.info["bodies"], [str(obstacle.name) for obstacle in run.obstacles])
    drawing = PaintedRenderer(run, cameras[0], width, run.obstacles, 2, cut=cut)
    with FilmFile(out, FRAMES_PER_SECOND) as file, drawing as renderer:
        for step, camera in zip(frames, cameras, strict=True):
            frame = Image.new("RGB", SIZE, BACKGROUND)
            pen = ImageDraw.Draw(frame)
            for place, pane in enumerate(panes):
                x, y = place % columns * (width + CELL_GAP), place // columns * (HEADER + height + CELL_GAP)
                frame.paste(renderer.painted(pane, step, camera), (x, y + HEADER))
                pen.text((x + 16, y + 22), pane.title, INK, font(19), anchor="lm")
                pen.text((x + 16, y + 46), f"{len(pane.level.cells):,} cells", FAINT_INK, font(14), anchor="lm")
                pen.text((x + width - 16, y + 22), f"{step * run.dt:.2f} s", INK, font(17), anchor="rm")
            file.add(frame)
    return fit_film(out)
