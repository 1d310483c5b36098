"""Frames of pictures in a grid, with words about them: of pictures, films, contact sheets and their films."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from pdvol.errors import InputError
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.draw.camera import Camera, cameras_of_run
from pdvol.studio.draw.cut import Cut, read_cut
from pdvol.studio.draw.flat import FlatRenderer
from pdvol.studio.draw.layout import BACKGROUND, CELL_GAP, INK, font
from pdvol.studio.draw.views import Shot, read_view

if TYPE_CHECKING:
    from pdvol.studio.draw.renderer import Renderer

MOMENT = 420  # pixels, the width of a picture where none is given
SMALLEST_PICTURE = 32  # pixels
_SHARPEST = 4096  # pixels, a side of a picture: up to it four pixels are rendered for each one


@dataclass(frozen=True)
class Pen:
    """Writes and draws on a page about a picture of a `size`, in pixels from the picture's upper left `corner`."""

    page: Image.Image
    corner: tuple[int, int]
    size: tuple[int, int]

    def text(self, x: float, y: float, text: str, size: float, ink: str = INK, anchor: str = "lm") -> None:
        """Write a line; `anchor` is Pillow's."""
        place = (self.corner[0] + x, self.corner[1] + y)
        ImageDraw.Draw(self.page).text(place, text, ink, font(size), anchor=anchor)

    def box(self, top: int, bottom: int, fill: str | None = None, outline: str | None = None) -> None:
        """Draw a rectangle as wide as the picture."""
        x, y = self.corner
        ImageDraw.Draw(self.page).rectangle((x, y + top, x + self.size[0] - 1, y + bottom - 1), fill, outline)


def _no_words(pen: Pen, step: int) -> None: ...


@dataclass(frozen=True, eq=False)
class Pane:
    """What a place of a grid shows.

    Attributes
    ----------
    run, level : drawn, at the last state where a frame is of a step that is not simulated yet; nothing where None
    words : writes about it at a step
    colours : (m, 3) in [0, 1], of the level's cells; those of bodies where None
    """

    run: Run | None
    level: RunLevel | None
    words: Callable[[Pen, int], None] = _no_words
    colours: np.ndarray | None = None


@dataclass(frozen=True)
class Grid:
    """Places of pictures on a page, row by row.

    Attributes
    ----------
    count, columns : how many there are, and how many in a row
    picture : (width, height) of each [pixels]
    above, below : room for words above and below each picture [pixels]
    gap : between places [pixels]
    margin : left of, above, right of and below all places [pixels]
    """

    count: int
    columns: int
    picture: tuple[int, int] = (0, 0)
    above: int = 0
    below: int = 0
    gap: int = CELL_GAP
    margin: tuple[int, int, int, int] = (0, 0, 0, 0)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the page [pixels]."""
        x, y = self.corner(self.columns * -(-self.count // self.columns) - 1)
        return x + self.picture[0] + self.margin[2], y + self.picture[1] + self.below + self.margin[3]

    def corner(self, place: int) -> tuple[int, int]:
        """(x, y) of a picture's upper left corner [pixels]."""
        row, column = divmod(place, self.columns)
        x = self.margin[0] + column * (self.picture[0] + self.gap)
        return x, self.margin[1] + self.above + row * (self.above + self.picture[1] + self.below + self.gap)

    def filling(self, size: tuple[int, int], aspect: float | None = None) -> "Grid":
        """The grid with the largest pictures on a page of a size, in its middle.

        Parameters
        ----------
        size : width and height of the page [pixels]
        aspect : width over height of what is shown, for the best number of columns; it stays as it is when None

        Raises
        ------
        InputError
            The pictures would be too small.
        """
        best, largest = self, 0.0
        for columns in range(1, self.count + 1) if aspect else (self.columns,):
            grid, rows = replace(self, columns=columns, picture=(0, 0)), -(-self.count // columns)
            width, height = (size[0] - grid.size[0]) // columns, (size[1] - grid.size[1]) // rows
            if min(width, height) >= SMALLEST_PICTURE and min(width / (aspect or 1.0), height) > largest:
                best, largest = replace(grid, picture=(width, height)), min(width / (aspect or 1.0), height)
        if not largest:
            raise InputError(
                f"{size[0]}x{size[1]} pixels are too small for {self.count} pictures; choose a larger size"
            )
        left, top, right, bottom = best.margin
        across, down = size[0] - best.size[0], size[1] - best.size[1]
        margin = (left + across // 2, top + down // 2, right + across - across // 2, bottom + down - down // 2)
        return replace(best, margin=margin)


def renderer_by(
    camera: Camera, size: tuple[int, int], oversampling: int = 2, facets: bool = False, cut: Cut | None = None
) -> "FlatRenderer | Renderer":
    """The renderer of 2D or of 3D scenes, as the camera's; parameters as for `Renderer`."""
    if camera.dim == 2:
        return FlatRenderer(camera, size, oversampling)
    from pdvol.studio.draw.renderer import Renderer

    return Renderer(camera, size, oversampling, facets, cut)


def frames(
    renderer: "FlatRenderer | Renderer | None",
    grid: Grid,
    panes: Sequence[Pane],
    moments: Iterable[Sequence[tuple[int, Camera | None]]],
) -> Iterator[Image.Image]:
    """The frame of each moment: one image, which the next moment changes where a pane's step or camera is another one.

    Parameters
    ----------
    renderer : None where no pane has a level
    panes : of each place
    moments : of each pane its step and camera; the renderer's camera for None
    """
    page = Image.new("RGB", grid.size, BACKGROUND)
    drawn: dict[int, tuple] = {}
    with renderer or nullcontext():
        for moment in moments:
            for place, (pane, (step, camera)) in enumerate(zip(panes, moment, strict=True)):
                held = step if pane.level is None else min(step, pane.level.steps - 1)
                if drawn.get(place) == (held, held == step, camera):
                    continue
                drawn[place] = (held, held == step, camera)
                pen = Pen(page, grid.corner(place), grid.picture)
                pen.box(-grid.above, grid.picture[1] + grid.below, fill=BACKGROUND)
                if renderer is not None and pane.run is not None and pane.level is not None:
                    page.paste(renderer.picture(pane.run, pane.level, held, camera, pane.colours), pen.corner)
                pane.words(pen, step)
            yield page


def composed(
    panes: Sequence[Pane], steps: Sequence[int], shot: Shot, grid: Grid, order: Sequence[Sequence[int]] | None = None
) -> Iterator[Image.Image]:
    """Frames of the panes of one run, all by one camera, which may move from step to step.

    Parameters
    ----------
    grid : without a size of pictures they are as wide as the shot says
    order : of each frame, and each pane in it, the place of its step among `steps`; a frame of each step when None

    Raises
    ------
    InputError
        The run has not what the shot shows.
    """
    run = next(pane.run for pane in panes if pane.run is not None)
    levels = list(dict.fromkeys(pane.level for pane in panes if pane.level is not None))
    aspect = grid.picture[0] / grid.picture[1] if grid.picture[1] else None
    cut = read_cut(shot.cut, run.info.get("bodies", []), [str(obstacle.name) for obstacle in run.obstacles])
    if cut is not None and levels[0].rest.shape[1] == 2:
        raise InputError(f"--cut: {run.path} is 2D, and nothing hides anything there")
    cameras = cameras_of_run(run, levels, steps, read_view(shot.view, shot.turn), aspect)
    if aspect is None:
        width = shot.width or MOMENT
        grid = replace(grid, picture=(width, max(2, round(width / cameras[0].aspect))))
    sharp = 2 if max(grid.picture) <= _SHARPEST else 1
    renderer = renderer_by(cameras[0], grid.picture, sharp, shot.facets, cut)
    places = order if order is not None else [[k] * len(panes) for k in range(len(steps))]
    return frames(renderer, grid, panes, ([(steps[k], cameras[k]) for k in each] for each in places))
