"""A contact sheet as a film: all variations side by side, at the speed of the simulated motion."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdvol.studio.draw.film import MOST_FRAMES_PER_SECOND, FilmFile
from pdvol.studio.draw.sheet import SHAPE, SheetLayout, Tile, TilePictures, drawn_level, shared_camera

WIDEST_FILM = 1920  # pixels, of a film of a few tiles
WIDEST_DENSE_FILM = 3840  # pixels, of one whose labels need more: players show 4K
DENSE_FROM = 5  # columns of tiles from which a film needs more
MOST_PICTURES = 2500  # tiles drawn in one film: minutes; with more tiles, fewer moments are drawn


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
