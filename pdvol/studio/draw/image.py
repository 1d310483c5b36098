"""A picture of a run in memory, for notebooks: a cell that ends with it shows it."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from pdvol.store.reader import Run
from pdvol.studio.draw.picture import render


def picture(
    run: Run,
    levels: Sequence[int] | None = None,
    steps: Sequence[int] | None = None,
    width: int = 420,
    turn: float = 0.0,
    camera: str = "",
) -> Image.Image:
    """Draw a run off screen: rows are levels, columns are moments.

    Parameters
    ----------
    run : Run
    levels : rows; all levels with a stored state when None
    steps : columns; chosen over time and motion when None
    width : int [pixels]
        Of one moment.
    turn : float [degrees]
        Angle of the camera about a 3D scene, from the front to its right.
    camera : "front", "side", "top", "three-quarter", "follow:BODY", or position and target, "X,Y,Z:TX,TY,TZ" [m]

    Returns
    -------
    PIL.Image.Image
        Notebooks show it; `numpy.asarray` gives its pixels (height, width, 3) uint8, `save` writes a file.

    Raises
    ------
    InputError
        Nothing is stored, or a level, step, view or body does not exist.
    """
    with tempfile.TemporaryDirectory(prefix="pdvol_") as folder:
        path = Path(folder) / "run.png"
        file = render(run, path, levels=levels, steps=steps, cell_width=width, turn=turn, view=camera)
        with Image.open(file) as drawn:
            return drawn.convert("RGB")
