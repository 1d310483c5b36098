"""A picture of how a level hangs on the one below it: who is bound where, and how far one coarse vertex reaches (paper,
figure 3 and 3.4.1).
"""

import colorsys
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
import scipy.sparse as sp
from PIL import Image, ImageDraw

from pdvol.draw.camera import ANGLE, View, lifted, view_of
from pdvol.draw.picture import FAINT, GAP, INK, font
from pdvol.draw.renderer import BACKGROUND, PALETTE
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.store.files import write_bytes

TOP = 64  # pixels for the captions
OVERSAMPLING = 2
NOTHING = (0.86, 0.85, 0.83)


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
    view = view_of(lifted(np.concatenate([coarse.points, fine.points])), fine.dim, np.asarray(up, dtype=float))
    chosen = nearest_vertex(coarse, view)
    column = weights[:, [chosen]].toarray()[:, 0]
    shown = np.unique(fine.boundary) if fine.dim == 3 else np.arange(len(fine.points))
    pictures = [
        _picture(coarse, fine, view, width, shown, cell_colours(cells)),
        _picture(coarse, fine, view, width, shown, weight_colours(column)),
    ]
    reach = f"on {np.count_nonzero(column):,} vertices, from {column.min():.2f} to {column.max():.2f}"
    captions = [
        (
            f"{title}: home cells",
            f"{len(fine.points):,} vertices in {len(np.unique(cells)):,} of {len(coarse.cells):,} cells",
        ),
        (f"one of {len(coarse.points):,} coordinates", reach),
    ]
    sheet = Image.new("RGB", (2 * width + GAP, TOP + pictures[0].height), BACKGROUND)
    pen = ImageDraw.Draw(sheet)
    for i, (picture, (large, small)) in enumerate(zip(pictures, captions, strict=True)):
        x = i * (width + GAP)
        sheet.paste(picture, (x, TOP))
        pen.text((x + width / 2, 0.36 * TOP), large, INK, font(19), anchor="mm")
        pen.text((x + width / 2, 0.74 * TOP), small, FAINT, font(14), anchor="mm")
    buffer = io.BytesIO()
    sheet.save(buffer, "PNG", optimize=True)
    write_bytes(path, buffer.getvalue())
    return path


def nearest_vertex(mesh: LevelMesh, view: View) -> int:
    """The vertex to be shown: of a 3D boundary the one most in front, in 2D the one closest to the middle."""
    if mesh.dim == 2:
        return int(np.argmin(np.linalg.norm(mesh.points - mesh.points.mean(axis=0), axis=1)))
    boundary = np.unique(mesh.boundary)
    return int(boundary[np.argmax(mesh.points[boundary] @ view.towards)])


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

    Roots of the weights are drawn, so that small ones can be told from none.
    """
    strength = np.sqrt(np.abs(weights) / np.abs(weights).max())
    strength = np.where(weights != 0, 0.12 + 0.88 * strength, 0.0)[:, None]
    full = np.where(weights[:, None] >= 0, pv.Color(PALETTE[0]).float_rgb, pv.Color(PALETTE[1]).float_rgb)
    return (1 - strength) * np.array(NOTHING) + strength * full


def _picture(
    coarse: LevelMesh, fine: LevelMesh, view: View, width: int, shown: np.ndarray, colours: np.ndarray
) -> Image.Image:
    size = (width, max(2, round(width / view.aspect)))
    with pv.vtk_verbosity("error"):  # as in studio.py
        plotter = pv.Plotter(
            off_screen=True,
            window_size=[OVERSAMPLING * n for n in size],
            lighting="light kit",
            theme=pv.themes.DocumentTheme(),
        )
        try:
            plotter.set_background(BACKGROUND)
            camera = plotter.camera
            camera.focal_point, camera.up, camera.position = (
                view.focus,
                view.up,
                view.focus + view.distance * view.towards,
            )
            camera.view_angle, camera.parallel_projection, camera.parallel_scale = (
                ANGLE,
                fine.dim == 2,
                view.half_height,
            )
            camera.clipping_range = (0.05 * view.distance, view.distance + 20 * view.size)
            # Points behind the fine surface are hidden by it; the coarse mesh is drawn as lines over both.
            if fine.dim == 3:
                surface = pv.PolyData.from_regular_faces(lifted(fine.points), fine.boundary)
                plotter.add_mesh(surface, color=BACKGROUND, ambient=0.35, diffuse=0.6, render=False, reset_camera=False)
            facets = coarse.boundary if coarse.dim == 3 else coarse.cells
            lines = pv.PolyData.from_regular_faces(lifted(coarse.points), facets)
            plotter.add_mesh(
                lines,
                style="wireframe",
                color=INK,
                opacity=0.5,
                line_width=OVERSAMPLING,
                lighting=False,
                render=False,
                reset_camera=False,
            )
            dots = pv.PolyData(lifted(fine.points[shown]))
            dots["colour"] = np.round(255 * colours[shown]).astype(np.uint8)
            across = float(np.clip(0.55 * size[1] / np.sqrt(len(shown)), 3.0, 16.0))
            plotter.add_mesh(
                dots,
                scalars="colour",
                rgb=True,
                style="points",
                point_size=OVERSAMPLING * across,
                render_points_as_spheres=True,
                lighting=False,
                render=False,
                reset_camera=False,
            )
            plotter.render()
            image = plotter.screenshot(None, return_img=True)
        finally:
            plotter.close()
    return Image.fromarray(image).resize(size, Image.Resampling.LANCZOS)
