"""Films whose colours mean something: the cell of level 0 that a cell of level 1 is bound to, or the gap to what is
nearest (paper, figures "robust vertex-element binding" and "contact geometry resolution and conformity").
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from PIL import Image, ImageDraw

from demos.gallery.entries import Entry, Further
from demos.gallery.film import FRAMES_PER_SECOND, film_frames, fit_film
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.draw.bindings import cell_colours
from pdvol.studio.draw.camera import Camera
from pdvol.studio.draw.camera_path import cameras_of_run
from pdvol.studio.draw.cut import read_cut
from pdvol.studio.draw.film import FilmFile
from pdvol.studio.draw.layout import BACKGROUND, CELL_GAP, FAINT_INK, INK, font, grid
from pdvol.studio.draw.renderer import Renderer
from pdvol.studio.draw.views import read_view
from pdvol.studio.shown import PALETTE

HEADER = 64  # pixels above each picture, for captions
MATERIAL = {"ambient": 0.62, "diffuse": 0.58, "specular": 0.06}  # of painted bodies: light that spares their colours
NEAR, FAR = 1e-4, 1e-1  # m, the gaps at the ends of the scale of colours
SCALE = ("#8c1537", "#e8603c", "#f6c667", "#e9eaec")  # from near to far, at equal ratios of gaps
TINT = 0.45  # of a body's own colour in what is far from all others: bodies can be distinguished
LEGEND = (200, 10)  # pixels, of the bar that shows the scale


@dataclass(frozen=True)
class Pane:
    """One picture of each frame.

    Attributes
    ----------
    title, small : above it
    level : drawn
    paint : function of a step: colours (n, 3) of the level's vertices, or (m, 3) of its cells, in [0, 1]
    """

    title: str
    small: str
    level: RunLevel
    paint: Callable[[int], np.ndarray]


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
        colours = np.round(255 * self._pane.paint(step)).astype(np.uint8)
        of_cells = len(colours) == len(level.cells)
        if of_cells:
            shape.cell_data["colour"] = colours[mine]
        else:
            shape.point_data["colour"] = colours
        if self._cut is not None and self._cut.through(str(self.run.info["bodies"][body]), True):
            shape = self._cut.left(shape, self._view.towards)
        skin = shape.extract_surface(algorithm="dataset_surface").triangulate()
        if skin.n_cells:
            style = {"smooth_shading": False} if of_cells else {"smooth_shading": True, "split_sharp_edges": True}
            self._plotter.add_mesh(
                skin, scalars="colour", rgb=True, **style, **MATERIAL, reset_camera=False, render=False
            )
        return np.asarray(skin.points, dtype=float)[skin.regular_faces]


def binding_panes(entry: Entry, run: Run) -> list[Pane]:
    """Level 0, level 1 as it is bound, and as it would be bound to the nearest cells: cells of level 1 have the colour
    of their home cell. A demo may name colours of its own by a function `colours(run)` of the cells of level 0.
    """
    from mpi4py import MPI

    from pdvol.levels.binding import closest_binding, home_cells
    from pdvol.levels.hierarchy import Hierarchy
    from pdvol.runs.scene_file import load_module

    pair = Hierarchy([level.mesh for level in run.levels[:2]], MPI.COMM_SELF, run.info["prolongation"]).prolongation(1)
    coarse, fine = run.levels[:2]
    own = getattr(load_module(entry.file), "colours", lambda _: cell_colours(np.arange(len(coarse.cells))))(run)
    panes = [Pane("level 0", f"{len(coarse.cells):,} cells", coarse, lambda _: own)]
    nearest = closest_binding(pair.fine, pair.coarse)
    for title, binding in (("level 1, by pdvol", pair.binding), ("level 1, nearest cells", nearest)):
        colours = own[home_cells(pair.fine, pair.coarse, binding)]
        panes.append(Pane(title, f"{len(fine.cells):,} cells", fine, lambda _, colours=colours: colours))
    return panes


def gap_panes(entry: Entry, run: Run) -> list[Pane]:
    """A level each, its surface coloured by the gap to the nearest other body or obstacle."""
    return [
        Pane(
            f"level {level.index}",
            f"{len(level.rest):,} vertices",
            level,
            lambda step, level=level: gap_colours(gaps(run, level, step), level.mesh.point_bodies),
        )
        for level in run.levels
    ]


def gaps(run: Run, level: RunLevel, step: int) -> np.ndarray:
    """(n,) [m]: from each vertex of the surface to the nearest other body or obstacle; infinite inside."""
    import igl

    positions, owners = level.positions(step), level.mesh.point_bodies
    found, surface = np.full(len(positions), np.inf), np.unique(level.surface)
    others = [
        (np.flatnonzero(owners[surface] != body), positions, level.surface[owners[level.surface[:, 0]] == body])
        for body in np.unique(owners)
    ]
    for obstacle in level.placed(run.obstacles, step):
        if obstacle.kind == "plane":
            point, normal = obstacle.plane(step)
            found[surface] = np.minimum(found[surface], (positions[surface] - point) @ normal)
        else:
            others.append((np.arange(len(surface)), obstacle.vertices(step), obstacle.arrays["faces"]))
    for seen, vertices, faces in others:
        seen = surface[seen]
        squares = igl.point_mesh_squared_distance(
            np.ascontiguousarray(positions[seen]),
            np.ascontiguousarray(vertices, dtype=np.float64),
            np.ascontiguousarray(faces, dtype=np.int64),
        )[0]
        found[seen] = np.minimum(found[seen], np.sqrt(np.maximum(squares, 0.0)))
    return found


def gap_colours(found: np.ndarray, owners: np.ndarray | None = None) -> np.ndarray:
    """(n, 3) in [0, 1]: colours of gaps (n,) [m] on the scale from `NEAR` to `FAR`, by their logarithm; tinted far away
    where the bodies (n,) that vertices belong to are given.
    """
    fraction = np.log(np.clip(found, NEAR, FAR) / NEAR) / np.log(FAR / NEAR)
    ends = np.linspace(0.0, 1.0, len(SCALE))
    colours = np.array([pv.Color(name).float_rgb for name in SCALE])
    shown = np.column_stack([np.interp(fraction, ends, channel) for channel in colours.T])
    if owners is None:
        return shown
    own = np.array([pv.Color(name).float_rgb for name in PALETTE])[owners % len(PALETTE)]
    tint = TINT * np.clip(3.0 * fraction - 2.0, 0.0, 1.0)[:, None]
    return (1.0 - tint) * shown + tint * own


SUBJECTS: Mapping[str, Callable[[Entry, Run], list[Pane]]] = {"bound": binding_panes, "gaps": gap_panes}


def write_further(entry: Entry, film: Further, run: Run, out: Path) -> Path:
    """Write one more film of an entry."""
    panes = SUBJECTS[film.name](entry, run)
    levels = list({pane.level.index: pane.level for pane in panes}.values())
    frames = film_frames(run.info["steps"], run.dt, film.slow)
    view = read_view(film.view)
    content = cameras_of_run(run, levels, frames, run.obstacles, 0.0, view)[0].aspect
    columns, (width, height) = grid(len(panes), film.size, content, HEADER)
    cameras = cameras_of_run(run, levels, frames, run.obstacles, 0.0, view, False, width / height)
    cut = read_cut(film.cut, run.info["bodies"], [str(obstacle.name) for obstacle in run.obstacles])
    drawing = PaintedRenderer(run, cameras[0], width, run.obstacles, 2, cut=cut)
    with FilmFile(out, FRAMES_PER_SECOND) as file, drawing as renderer:
        for step, camera in zip(frames, cameras, strict=True):
            frame = Image.new("RGB", film.size, BACKGROUND)
            pen = ImageDraw.Draw(frame)
            for place, pane in enumerate(panes):
                x, y = place % columns * (width + CELL_GAP), place // columns * (HEADER + height + CELL_GAP)
                frame.paste(renderer.painted(pane, step, camera), (x, y + HEADER))
                pen.text((x + 16, y + 22), pane.title, INK, font(19), anchor="lm")
                pen.text((x + 16, y + 46), pane.small, FAINT_INK, font(14), anchor="lm")
                pen.text((x + width - 16, y + 22), f"{step * run.dt:.2f} s", INK, font(17), anchor="rm")
            if film.name == "gaps":
                _draw_scale(frame)
            file.add(frame)
    return fit_film(out)


def _draw_scale(frame: Image.Image) -> None:
    """The scale of gaps, above the last picture."""
    pen = ImageDraw.Draw(frame)
    left, top = frame.width - LEGEND[0] - 110, 16
    fractions = np.linspace(0.0, 1.0, LEGEND[0])
    for place, colour in enumerate(gap_colours(NEAR * (FAR / NEAR) ** fractions)):
        pen.line((left + place, top, left + place, top + LEGEND[1]), tuple(np.round(255 * colour).astype(int)))
    for fraction, text in ((0.0, "0.1 mm"), (1 / 3, "1 mm"), (2 / 3, "1 cm"), (1.0, "10 cm")):
        pen.text((left + fraction * LEGEND[0], top + LEGEND[1] + 10), text, INK, font(12), anchor="mm")
