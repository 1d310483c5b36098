"""A picture of how a level is bound to the one below it: the home cell of each vertex, and the weights of one coarse
vertex (paper, figure 3 and 3.4.1).
"""

import colorsys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyvista as pv
import scipy.sparse as sp
from PIL import Image

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.store.files import make_folder
from pdvol.store.series import in_3d
from pdvol.studio.draw.camera import Camera, fitted_camera
from pdvol.studio.draw.compose import Grid, Pen
from pdvol.studio.draw.layout import BACKGROUND, FAINT_INK, INK, write_png
from pdvol.studio.draw.renderer import Window
from pdvol.studio.shown import PALETTE

if TYPE_CHECKING:
    from pdvol.levels.hierarchy import Hierarchy  # of finite elements, which drawing does not load

CAPTION_HEIGHT = 64  # pixels above the two views
ZERO_COLOUR = (0.86, 0.85, 0.83)  # red, green and blue of vertices without a weight


def draw_bindings(hierarchy: "Hierarchy", out: Path, up: Sequence[float] = (0.0, 1.0, 0.0)) -> None:
    """Draw `out/binding_<level>.png` for each level but the coarsest; `up` is the way up of a 3D scene.

    Raises
    ------
    InputError
        The folder `out` cannot be made.
    """
    make_folder(out)
    for level in range(1, len(hierarchy)):
        p = hierarchy.prolongation(level)
        title = f"levels {level - 1} -> {level}, {hierarchy.interpolant}"
        draw_binding(out / f"binding_{level}.png", p.coarse.mesh, p.fine.mesh, p.binding.cells, p.weights(), title, up)


def draw_binding(
    path: Path,
    coarse: LevelMesh,
    fine: LevelMesh,
    cells: np.ndarray,
    weights: sp.csr_matrix,
    title: str,
    up: Sequence[float] = (0.0, 1.0, 0.0),
    width: int = 640,
) -> Path:
    """Draw two views of one pair of levels into a .png.

    Left, fine vertices as dots on the coarse mesh, those of the same home cell in the same colour. Right, the weights
    of one coarse vertex on the fine ones: warm where positive, cool where negative, grey where there is none.

    Parameters
    ----------
    cells : (n_fine,) int
        Home cells (`Binding.cells`).
    weights : (n_fine, n_coarse)
        Of the prolongation.
    title : what the pair is called
    up : the way up of a 3D pair; y as in most surface files
    """
    camera = fitted_camera(in_3d(np.concatenate([coarse.points, fine.points])), fine.dim, np.asarray(up, dtype=float))
    column = weights[:, [nearest_vertex(coarse, camera)]].toarray()[:, 0]
    shown = np.unique(fine.boundary) if fine.dim == 3 else np.arange(len(fine.points))
    reach = f"on {np.count_nonzero(column):,} vertices, from {column.min():.2f} to {column.max():.2f}"
    homes = f"{len(fine.points):,} vertices in {len(np.unique(cells)):,} of {len(coarse.cells):,} cells"
    grid = Grid(2, 2, (width, max(2, round(width / camera.aspect))), above=CAPTION_HEIGHT)
    page = Image.new("RGB", grid.size, BACKGROUND)
    for place, (colours, large, small) in enumerate(
        (
            (cell_colours(cells), f"{title}: home cells", homes),
            (weight_colours(column), f"one of {len(coarse.points):,} coordinates", reach),
        )
    ):
        pen = Pen(page, grid.corner(place), grid.picture)
        with Window(camera, grid.picture, lighting="light kit") as window:
            page.paste(_picture(window, coarse, fine, shown, colours[shown]), pen.corner)
        pen.text(width / 2, -0.64 * CAPTION_HEIGHT, large, 19, anchor="mm")
        pen.text(width / 2, -0.26 * CAPTION_HEIGHT, small, 14, FAINT_INK, "mm")
    return write_png(path, page)


def nearest_vertex(mesh: LevelMesh, camera: Camera) -> int:
    """The vertex whose weights are drawn: of a 3D boundary the one nearest to the camera, in 2D the one nearest to the
    middle.
    """
    if mesh.dim == 2:
        return int(np.argmin(np.linalg.norm(mesh.points - mesh.points.mean(axis=0), axis=1)))
    boundary = np.unique(mesh.boundary)
    return int(boundary[np.argmax(mesh.points[boundary] @ camera.towards)])


def cell_colours(cells: np.ndarray) -> np.ndarray:
    """(n, 3) in [0, 1]: the same colour for the same cell, and hues far apart for cells that follow each other."""
    homes, which = np.unique(cells, return_inverse=True)
    golden = 0.5 * (5.0**0.5 - 1.0)
    table = np.array(
        [colorsys.hls_to_rgb((golden * i) % 1.0, (0.42, 0.56, 0.68)[i % 3], 0.65) for i in range(len(homes))]
    )
    return table[which]


def weight_colours(weights: np.ndarray) -> np.ndarray:
    """(n, 3) in [0, 1]: the palette's first colour for the largest absolute weight if positive, its second if negative,
    grey for none.

    The colours show roots of the weights, so that small ones differ from none.
    """
    strength = np.sqrt(np.abs(weights) / np.abs(weights).max())
    strength = np.where(weights != 0, 0.12 + 0.88 * strength, 0.0)[:, None]
    full = np.where(weights[:, None] >= 0, pv.Color(PALETTE[0]).float_rgb, pv.Color(PALETTE[1]).float_rgb)
    return (1 - strength) * np.array(ZERO_COLOUR) + strength * full


def _picture(window: Window, coarse: LevelMesh, fine: LevelMesh, shown: np.ndarray, colours: np.ndarray) -> Image.Image:
    """Dots of the colours (k, 3) at the fine vertices `shown` (k,), with the coarse mesh as lines over them. Vertices
    behind the fine surface are hidden by it.
    """
    if fine.dim == 3:
        surface = pv.PolyData.from_regular_faces(in_3d(fine.points), fine.boundary)
        window.add(surface, color=BACKGROUND, ambient=0.35, diffuse=0.6)
    lines = pv.PolyData.from_regular_faces(in_3d(coarse.points), coarse.boundary if coarse.dim == 3 else coarse.cells)
    window.add(lines, style="wireframe", color=INK, opacity=0.5, line_width=window.oversampling, lighting=False)
    dots = pv.PolyData(in_3d(fine.points[shown]))
    dots["colour"] = np.round(255 * colours).astype(np.uint8)
    size = window.oversampling * float(np.clip(0.55 * window.size[1] / np.sqrt(len(shown)), 3.0, 16.0))
    style = {"style": "points", "point_size": size, "render_points_as_spheres": True, "lighting": False}
    window.add(dots, scalars="colour", rgb=True, **style)
    return window.image(window.camera)
