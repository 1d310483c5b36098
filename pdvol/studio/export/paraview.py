"""The script that opens an export in ParaView: warped by the displacement, bodies in the colours of pictures."""

from collections.abc import Sequence
from pathlib import Path

from pdvol.store.reader import Run
from pdvol.studio.export.files import write_script
from pdvol.studio.shown import PALETTE, srgb_colour, upward_in_3d


def write_paraview_script(run: Run, levels: Sequence[int], out: Path, ending: str) -> Path:
    """Write `out/open_in_paraview.py` for the files `level_<l>ENDING`; the finest level is shown, others are hidden."""
    names = [str(name) for name in run.info.get("bodies", [])]
    colours = [tuple(round(part, 4) for part in srgb_colour(PALETTE[i % len(PALETTE)])) for i in range(len(names))]
    up = upward_in_3d(run)
    return write_script(
        out,
        "open_in_paraview",
        ENDING=ending,
        LEVELS=sorted(levels),
        BODIES=names,
        COLOURS=colours,
        UP=tuple(up.tolist()),
        FLAT=run.levels[0].rest.shape[1] == 2,
    )
