"""A contact sheet: one picture of many runs of a scene, a labelled tile each, all with one camera; or a film, in which
they go at the speed of the simulated motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from pdvol.errors import InputError
from pdvol.store.reader import Run, RunLevel
from pdvol.store.series import in_3d
from pdvol.studio.draw.camera import Camera, content_of_run, fitted_camera
from pdvol.studio.draw.film import MOST_FRAMES_PER_SECOND, FilmFile
from pdvol.studio.draw.framing import outermost
from pdvol.studio.draw.layout import BACKGROUND, INK, cluster_name, font, write_png
from pdvol.studio.draw.renderer import Renderer
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


def sheet_image(
    tiles: Sequence[Tile],
    out: str | Path,
    columns: int | None = None,
    step: int | None = None,
    turn: float = 0.0,
    apart: Path | None = None,
) -> Path:
    """Draw the tiles, in the order given, into a .png.

    Parameters
    ----------
    tiles : 1 to `MOST_TILES`
    out : the file
    columns : chosen from the number of tiles when None
    step : drawn of each run; its last one when None, or where it ended before
    turn : angle of the camera about a 3D scene, from the front to its right [degrees]
    apart : a folder that gets the picture of each tile as a file of its own, `TITLE.png`

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        No tiles or too many, or another ending than .png.
    """
    out = Path(out)
    if out.suffix.lower() != ".png":
        raise InputError(f"{out}: the name of a contact sheet's picture ends in .png")
    camera = shared_camera(tiles, turn)
    layout = SheetLayout.of(tiles, camera.aspect if camera else SHAPE, columns)
    sheet = layout.empty()
    with TilePictures(tiles, camera, layout.picture[0]) as pictures:
        for number, tile in enumerate(tiles):
            shown = None if tile.run is None else pictures.of(number, step)
            layout.put(sheet, number, shown)
            if apart is not None and shown is not None:
                write_png(apart / f"{tile.title}.png", shown)
    return write_png(out, sheet)


def sheet_film(
    tiles: Sequence[Tile], out: str | Path, columns: int | None = None, turn: float = 0.0, speed: float = 1.0
) -> Path:
    """Film the tiles, in the order given, into a .gif, .mp4 or .webp. A run that ended before the others keeps its
    last state.

    Parameters
    ----------
    tiles : as for `sheet_image`
    out : the file
    columns : chosen from the number of tiles when None
    turn : angle of the camera about a 3D scene [degrees]
    speed : of the film, in times the simulated motion's

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        No tiles or too many, no run with a state among them, another ending, or the films' extra is not installed.
    SimulationError
        The disk cannot be written.
    """
    camera = shared_camera(tiles, turn)
    out = Path(out)
    narrow = SheetLayout.of(tiles, camera.aspect if camera else SHAPE, columns, WIDEST_FILM)
    layout = (
        narrow
        if narrow.columns < DENSE_FROM
        else SheetLayout.of(tiles, narrow.picture[0] / narrow.picture[1], columns, WIDEST_DENSE_FILM)
    )
    moments, rate = film_times(tiles, speed)
    out.parent.mkdir(parents=True, exist_ok=True)
    sheet = layout.empty()
    with FilmFile(out, rate) as film, TilePictures(tiles, camera, layout.picture[0], oversampling=1) as pictures:
        for number in range(len(tiles)):
            layout.put(sheet, number, None)
        drawn: dict[int, int] = {}
        for moment in moments:
            for number, tile in enumerate(tiles):
                level = drawn_level(tile.run)
                if tile.run is None or level is None:
                    continue
                step = min(round(moment / tile.run.dt), level.steps - 1)
                if drawn.get(number) != step:
                    layout.show(sheet, number, pictures.of(number, step))
                    drawn[number] = step
            film.add(sheet)
    return out


def film_times(tiles: Sequence[Tile], speed: float = 1.0) -> tuple[np.ndarray, float]:
    """The moments [s] that are drawn, and frames per second: no finer than the finest time step, and fewer where there
    are so many tiles that drawing would take longer than minutes.
    """
    runs = [(level, tile.run.dt) for tile in tiles if tile.run and (level := drawn_level(tile.run)) is not None]
    if not runs:
        return np.zeros(1), 1.0
    length, dt = max((level.steps - 1) * dt for level, dt in runs), min(dt for _, dt in runs)
    shortest = max(dt, speed / MOST_FRAMES_PER_SECOND, length * len(runs) / MOST_PICTURES)
    count = max(1, round(length / shortest))
    return np.linspace(0.0, length, count + 1), max(1.0, speed * count / length) if length > 0.0 else 1.0


def drawn_level(run: Run | None) -> RunLevel | None:
    """The finest level of a run that has a state; None without one."""
    return None if run is None else next((level for level in reversed(run.levels) if level.steps), None)


def shared_camera(tiles: Sequence[Tile], turn: float = 0.0) -> Camera | None:
    """The camera that shows the runs at some of their steps; None where there is no state at all. Where a few runs go
    much further than the others, the camera does not follow them, which would make all others small. It does follow
    the bodies that tiles name.
    """
    if not 1 <= len(tiles) <= MOST_TILES:
        raise InputError(f"a contact sheet has 1 to {MOST_TILES} tiles, not {len(tiles)}")
    content, named, up, dim = [], [], np.array([0.0, 0.0, 1.0]), 3
    for tile in tiles:
        level = drawn_level(tile.run)
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
    return fitted_camera(np.concatenate([np.clip(np.concatenate(content), low, high), *named]), dim, up, turn)


class TilePictures:
    """Renders the runs of tiles, in a `with` block; one window for all."""

    def __init__(self, tiles: Sequence[Tile], camera: Camera | None, width: int, oversampling: int = 2):
        self.tiles = tiles
        first = next((tile.run for tile in tiles if drawn_level(tile.run) is not None), None)
        self._renderer = None if first is None or camera is None else Renderer(first, camera, width, (), oversampling)

    def of(self, number: int, step: int | None) -> Image.Image | None:
        """The picture of a tile at a step, its last one when None or where it ended before; None without a state."""
        run = self.tiles[number].run
        level = drawn_level(run)
        if run is None or level is None or self._renderer is None:
            return None
        last = level.steps - 1
        self._renderer.run, self._renderer.obstacles = run, run.obstacles
        return self._renderer.picture(level, last if step is None else min(step, last))

    def __enter__(self) -> "TilePictures":
        if self._renderer is not None:
            self._renderer.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        if self._renderer is not None:
            self._renderer.__exit__(*error)


@dataclass(frozen=True)
class SheetLayout:
    """Where tiles and their labels are.

    Attributes
    ----------
    tiles : sequence of Tile
    columns : int
    picture : (width, height) of a tile's picture [pixels]
    labels : of each tile its lines of text, wrapped
    text : size of the letters [pixels]
    """

    tiles: Sequence[Tile]
    columns: int
    picture: tuple[int, int]
    labels: Sequence[Sequence[str]]
    text: float

    @classmethod
    def of(cls, tiles: Sequence[Tile], aspect: float, columns: int | None, widest: int = WIDEST_SHEET) -> "SheetLayout":
        """The layout of tiles with pictures of this aspect."""
        count = len(tiles)
        if columns is not None and columns < 1:
            raise InputError(f"columns = {columns} of a contact sheet must be at least 1")
        lines = max(len(tile.lines) for tile in tiles) + 1
        if columns is None:
            tall = 1.0 / aspect + 0.09 * lines  # a tile's height over its width, about
            most = (widest - TILE_GAP) // (NARROWEST_TILE + TILE_GAP)
            columns = max(1, min(count, most, round(np.sqrt(count * tall * SHAPE))))
        width = int(np.clip((widest - TILE_GAP) // columns - TILE_GAP, NARROWEST_TILE, WIDEST_TILE))
        width -= width % 2
        text = float(np.clip(LABEL_SIZE * width / 420, LEAST_LABEL_SIZE, LABEL_SIZE))
        height = max(2, round(width / aspect))
        labels = [wrapped(tile.lines, width, text) for tile in tiles]
        return cls(tiles, columns, (width, height), labels, text)

    @property
    def rows(self) -> int:
        """How many rows of tiles there are."""
        return -(-len(self.tiles) // self.columns)

    @property
    def line(self) -> int:
        """[pixels] from one line of a label to the next."""
        return round(1.3 * self.text)

    @property
    def tile_size(self) -> tuple[int, int]:
        """(width, height) of a tile with its label [pixels]: the longest one fits into all."""
        label = self.line * (1 + max(len(lines) for lines in self.labels))
        return self.picture[0], RULE + self.picture[1] + label + TILE_GAP // 2

    def empty(self) -> Image.Image:
        """A sheet without tiles; its sides are even, as encoders of films need them."""
        across, down = (
            n * (size + TILE_GAP) + TILE_GAP for n, size in zip((self.columns, self.rows), self.tile_size, strict=True)
        )
        return Image.new("RGB", (across + across % 2, down + down % 2), BACKGROUND)

    def corner(self, number: int) -> tuple[int, int]:
        """(x, y) of a tile's upper left corner [pixels]."""
        row, column = divmod(number, self.columns)
        width, height = self.tile_size
        return TILE_GAP + column * (width + TILE_GAP), TILE_GAP + row * (height + TILE_GAP)

    def put(self, sheet: Image.Image, number: int, picture: Image.Image | None) -> None:
        """Draw a tile: its picture, or why there is none, its cluster and its label."""
        tile, (x, y), pen = self.tiles[number], self.corner(number), ImageDraw.Draw(sheet)
        self.show(sheet, number, picture)
        top = y + RULE + self.picture[1] + TILE_GAP // 2
        letters = font(self.text)
        pen.text((x, top), tile.title, INK, font(1.1 * self.text))
        if tile.cluster >= 0:
            colour = PALETTE[tile.cluster % len(PALETTE)]
            pen.rectangle((x, y, x + self.picture[0] - 1, y + RULE - 1), colour)
            pen.text((x + self.picture[0], top), cluster_name(tile.cluster), INK, letters, anchor="ra")
        for k, line in enumerate(self.labels[number], 1):
            pen.text((x, top + k * self.line), line, INK, letters)

    def show(self, sheet: Image.Image, number: int, picture: Image.Image | None) -> None:
        """Draw a tile's picture only, or a frame with its note."""
        tile, (x, y), pen = self.tiles[number], self.corner(number), ImageDraw.Draw(sheet)
        width, height = self.picture
        y += RULE
        if picture is not None:
            sheet.paste(picture, (x, y))
        else:
            pen.rectangle((x, y, x + width - 1, y + height - 1), "#ece8e0")
        note = tile.note or ("" if picture is not None else "nothing is stored")
        if note:
            rows = wrapped([note], width - 2 * TILE_GAP, self.text)
            fits = max(1, (height - TILE_GAP) // self.line)
            rows = rows if len(rows) <= fits else [*rows[: fits - 1], rows[fits - 1] + " ..."]
            start = y + (height - len(rows) * self.line) // 2 if picture is None else y + TILE_GAP // 2
            for k, row in enumerate(rows):
                pen.text(
                    (x + TILE_GAP, start + k * self.line), row, INK if picture is None else "#a04020", font(self.text)
                )
        pen.rectangle((x, y, x + width - 1, y + height - 1), outline="#dcd7cd")


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
