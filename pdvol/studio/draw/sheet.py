"""A contact sheet: one picture of many runs of a scene, a labelled tile each, all with one camera; or a film, in which
they go at the speed of the simulated motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.store.reader import Run, RunLevel
from pdvol.store.series import in_3d
from pdvol.studio.draw.camera import Camera, content_of_run, fitted_camera
from pdvol.studio.draw.compose import Grid, Pane, Pen, frames, renderer_by
from pdvol.studio.draw.film import MOST_FRAMES_PER_SECOND, write_film
from pdvol.studio.draw.framing import outermost
from pdvol.studio.draw.layout import INK, cluster_name, font, write_png
from pdvol.studio.shown import PALETTE, upward

WIDEST_SHEET = 4000  # pixels
WIDEST_TILE = 560  # pixels: more shows no more of a coarse level
NARROWEST_TILE = 240  # pixels: labels do not fit into fewer
MOST_TILES = 400  # of a sheet
LABEL_SIZE = 19  # pixels, of a label's letters at the widest tile; small tiles have smaller ones
LEAST_LABEL_SIZE = 14  # pixels
TILE_GAP = 14  # pixels between tiles
RULE = 6  # pixels, the height of a cluster's rule
SEEN_STEPS = 12  # of each run, for the camera
STRAYS = 0.1  # fraction of the runs that may leave the picture on each side
SHAPE = 1.5  # a sheet's width over its height that is aimed at
WIDEST_FILM = 1920  # pixels, of a film of a few tiles
WIDEST_DENSE_FILM = 3840  # pixels, of one whose labels need more: players show 4K
DENSE_FROM = 5  # columns of tiles from which a film needs more
MOST_PICTURES = 2500  # tiles drawn in one film: minutes; with more tiles, fewer moments are drawn


@dataclass(frozen=True)
class Tile:
    """One variation of a contact sheet.

    Attributes
    ----------
    title : its number or name
    lines : its parameters and scores, a line each; long ones are wrapped, never cut
    run : what it shows; None where nothing is stored
    note : shown instead of a run, or with one that ended early: why
    cluster : its group, shown by a coloured rule and a letter; -1 for none
    bodies : names of those that the picture must not lose, whatever the other runs do: a score asks for them
    """

    title: str
    lines: Sequence[str]
    run: Run | None
    note: str = ""
    cluster: int = -1
    bodies: Sequence[str] = ()

    @property
    def level(self) -> RunLevel | None:
        """The finest level that has a state; None without one."""
        return None if self.run is None else next((level for level in reversed(self.run.levels) if level.steps), None)


def sheet_image(tiles: Sequence[Tile], out: str | Path, apart: Path | None = None, facets: bool = False) -> Path:
    """Draw the end of the tiles' runs, in the order given, into a .png.

    Parameters
    ----------
    tiles : 1 to `MOST_TILES`
    out : the file, which is returned
    apart : a folder that gets the picture of each tile as a file of its own, `TITLE.png`
    facets : whether bodies that carry render meshes are drawn by their cells

    Raises
    ------
    InputError
        No tiles or too many, or another ending than .png.
    """
    out = Path(out)
    if out.suffix.lower() != ".png":
        raise InputError(f"{out}: the name of a contact sheet's picture ends in .png")
    camera = shared_camera(tiles)
    grid = sheet_grid(tiles, camera.aspect if camera else SHAPE)
    ends = [(level.steps - 1 if (level := tile.level) else 0, camera) for tile in tiles]
    renderer = renderer_by(camera, grid.picture, facets=facets) if camera else None
    (sheet,) = frames(renderer, grid, _panes(tiles, grid), [ends])
    for number, tile in enumerate(tiles):
        if apart is not None and tile.level is not None:
            x, y = grid.corner(number)
            write_png(apart / f"{tile.title}.png", sheet.crop((x, y, x + grid.picture[0], y + grid.picture[1])))
    return write_png(out, sheet)


def sheet_film(tiles: Sequence[Tile], out: str | Path, facets: bool = False) -> Path:
    """Film the tiles, in the order given, into a .gif, .mp4 or .webp. A run that ended before the others keeps its
    last state.

    Parameters
    ----------
    tiles, facets : as for `sheet_image`
    out : the file, which is returned

    Raises
    ------
    InputError
        No tiles or too many, another ending, or the films' extra is not installed.
    SimulationError
        The disk cannot be written.
    """
    out, camera = Path(out), shared_camera(tiles)
    aspect = camera.aspect if camera else SHAPE
    grid = sheet_grid(tiles, aspect, WIDEST_FILM)
    if grid.columns >= DENSE_FROM:
        grid = sheet_grid(tiles, aspect, WIDEST_DENSE_FILM)
    times, rate = film_times(tiles)
    moments = ([(round(time / tile.run.dt) if tile.run else 0, camera) for tile in tiles] for time in times)
    renderer = renderer_by(camera, grid.picture, 1, facets) if camera else None
    out.parent.mkdir(parents=True, exist_ok=True)
    return write_film(out, frames(renderer, grid, _panes(tiles, grid), moments), rate)


def film_times(tiles: Sequence[Tile]) -> tuple[np.ndarray, float]:
    """The moments [s] that are drawn, and frames per second: no finer than the finest time step, and fewer where there
    are so many tiles that drawing would take longer than minutes.
    """
    runs = [(level, tile.run.dt) for tile in tiles if tile.run and (level := tile.level)]
    if not runs:
        return np.zeros(1), 1.0
    length, dt = max((level.steps - 1) * dt for level, dt in runs), min(dt for _, dt in runs)
    shortest = max(dt, 1.0 / MOST_FRAMES_PER_SECOND, length * len(runs) / MOST_PICTURES)
    count = max(1, round(length / shortest))
    return np.linspace(0.0, length, count + 1), max(1.0, count / length) if length > 0.0 else 1.0


def shared_camera(tiles: Sequence[Tile]) -> Camera | None:
    """The camera that shows the runs at some of their steps; None where there is no state at all. Where a few runs go
    much further than the others, the camera does not follow them, which would make all others small. It does follow
    the bodies that tiles name.
    """
    if not 1 <= len(tiles) <= MOST_TILES:
        raise InputError(f"a contact sheet has 1 to {MOST_TILES} tiles, not {len(tiles)}")
    content, named, up, dim = [], [], np.array([0.0, 0.0, 1.0]), 3
    for tile in tiles:
        level = tile.level
        if tile.run is None or level is None:
            continue
        steps = np.unique(np.linspace(0, level.steps - 1, SEEN_STEPS).round().astype(int)).tolist()
        content.append(content_of_run([level], steps, tile.run.obstacles))
        numbers = [number for number, name in enumerate(tile.run.info["bodies"]) if name in tile.bodies]
        mine = np.flatnonzero(np.isin(level.mesh.point_bodies, numbers))
        named += [outermost(in_3d(level.positions(step))[mine]) for step in steps if len(mine)]
        up, dim = upward(tile.run), level.rest.shape[1]
    if not content:
        return None
    low = np.quantile([points.min(axis=0) for points in content], STRAYS, axis=0)
    high = np.quantile([points.max(axis=0) for points in content], 1.0 - STRAYS, axis=0)
    points = np.concatenate([np.clip(np.concatenate(content), low, high), *named])
    return fitted_camera(points, dim, up)


def sheet_grid(tiles: Sequence[Tile], aspect: float, widest: int = WIDEST_SHEET) -> Grid:
    """The places of tiles with pictures of this aspect, on a sheet of at most this width [pixels]; the longest label
    fits into all.
    """
    count, lines = len(tiles), max(len(tile.lines) for tile in tiles) + 1
    tall = 1.0 / aspect + 0.09 * lines  # a tile's height over its width, about
    most = (widest - TILE_GAP) // (NARROWEST_TILE + TILE_GAP)
    columns = max(1, min(count, most, round(np.sqrt(count * tall * SHAPE))))
    width = int(np.clip((widest - TILE_GAP) // columns - TILE_GAP, NARROWEST_TILE, WIDEST_TILE))
    width -= width % 2
    size, line = _letters(width)
    below = line * (1 + max(len(wrapped(tile.lines, width, size)) for tile in tiles)) + TILE_GAP // 2
    picture, margin = (width, max(2, round(width / aspect))), (TILE_GAP,) * 4
    return Grid(count, columns, picture, above=RULE, below=below, gap=TILE_GAP, margin=margin)


def _letters(width: int) -> tuple[float, int]:
    """The size of letters, and the distance from one line to the next [pixels], of tiles of a width [pixels]."""
    size = float(np.clip(LABEL_SIZE * width / 420, LEAST_LABEL_SIZE, LABEL_SIZE))
    return size, round(1.3 * size)


def _panes(tiles: Sequence[Tile], grid: Grid) -> list[Pane]:
    """The tiles as places of a grid: the picture or a frame, its note, its cluster and its label."""
    width, height = grid.picture
    size, line = _letters(width)

    def pane(tile: Tile) -> Pane:
        level, label = tile.level, wrapped(tile.lines, width, size)
        note = wrapped([tile.note or ("" if level else "nothing is stored")], width - 2 * TILE_GAP, size)
        fits = max(1, (height - TILE_GAP) // line)
        note = note if len(note) <= fits else [*note[: fits - 1], note[fits - 1] + " ..."]

        def words(pen: Pen, step: int) -> None:
            if level is None:
                pen.box(0, height, fill="#ece8e0")
            start, ink = (TILE_GAP // 2, "#a04020") if level else ((height - len(note) * line) // 2, INK)
            for k, row in enumerate(note):
                pen.text(TILE_GAP, start + k * line, row, size, ink, "la")
            pen.box(0, height, outline="#dcd7cd")
            top = height + TILE_GAP // 2
            pen.text(0, top, tile.title, 1.1 * size, anchor="la")
            if tile.cluster >= 0:
                pen.box(-RULE, 0, fill=PALETTE[tile.cluster % len(PALETTE)])
                pen.text(width, top, cluster_name(tile.cluster), size, anchor="ra")
            for k, row in enumerate(label, 1):
                pen.text(0, top + k * line, row, size, anchor="la")

        return Pane(tile.run, level, words)

    return [pane(tile) for tile in tiles]


def wrapped(lines: Sequence[str], width: int, size: float) -> list[str]:
    """Lines of text broken to a width [pixels], at spaces where there are any; no character is lost."""
    letters = font(size)
    result: list[str] = []
    for line in lines:
        rest = line.strip()
        while rest:
            fits = len(rest)
            while fits > 1 and letters.getlength(rest[:fits]) > width:
                fits -= 1
            space = rest.rfind(" ", 1, fits + 1) if fits < len(rest) else -1
            cut = space if space > 0 else fits
            result.append(rest[:cut].rstrip())
            rest = rest[cut:].lstrip()
    return result
