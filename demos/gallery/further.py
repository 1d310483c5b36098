"""The film of a binding: cells in the colour of the cell of level 0 that they are bound to (paper, figure "robust
vertex-element binding").
"""

from pathlib import Path

import numpy as np

from demos.gallery.entries import Entry
from demos.gallery.film import FRAMES_PER_SECOND, film_frames, fit_film
from pdvol.store.reader import Run
from pdvol.studio.draw.bindings import cell_colours
from pdvol.studio.draw.camera import cameras_of_run
from pdvol.studio.draw.compose import Grid, Pane, composed
from pdvol.studio.draw.film import write_film
from pdvol.studio.draw.picture import FILM_HEADER, film_pane
from pdvol.studio.draw.views import Shot

SIZE = (1260, 440)  # pixels, of the film


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
    colours = getattr(load_module(entry.file), "colours", lambda run: cell_colours(np.arange(len(coarse.cells))))
    own, nearest = colours(run), closest_binding(pair.fine, pair.coarse)
    return [
        film_pane(run, level, title, f"{len(level.cells):,} cells", shown)
        for title, level, shown in (
            ("level 0", coarse, own),
            ("level 1, by pdvol", fine, own[home_cells(pair.fine, pair.coarse, pair.binding)]),
            ("level 1, nearest cells", fine, own[home_cells(pair.fine, pair.coarse, nearest)]),
        )
    ]


def write_bound(entry: Entry, run: Run, out: Path) -> Path:
    """Write the film of how level 1 is bound to level 0, cut as the entry says."""
    panes, frames = binding_panes(entry, run), film_frames(run.info["steps"], run.dt, entry.slow)
    content = cameras_of_run(run, run.levels[:2], frames)[0].aspect
    grid = Grid(len(panes), len(panes), above=FILM_HEADER).filling(SIZE, content)
    return fit_film(write_film(out, composed(panes, frames, Shot(cut=entry.bound), grid), FRAMES_PER_SECOND))
