"""The player in a notebook."""

import html
from collections.abc import Sequence
from dataclasses import dataclass

from pdvol.store.reader import Run
from pdvol.studio.play.document import player_page, with_strain
from pdvol.studio.play.panes import panes_of_run, thinned


@dataclass(frozen=True)
class PlayerFrame:
    """A player that notebooks show in a frame of this size [pixels]."""

    page: str
    width: int
    height: int

    def __repr__(self) -> str:
        return f"PlayerFrame({self.width} x {self.height}, {len(self.page) / 1e6:.1f} MB)"

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.page)}" width="{self.width}" height="{self.height}"'
            ' style="border: 0; max-width: 100%" title="pdvol player"></iframe>'
        )


def play(
    run: Run, width: int = 960, height: int = 640, levels: Sequence[int] | None = None, strain: bool = True
) -> PlayerFrame:
    """A run's levels in the player; a notebook's cell that ends with it shows it.

    Parameters
    ----------
    run : Run
    width, height : int [pixels]
    levels : all with a stored state when None
    strain : whether bodies can be coloured by it

    Raises
    ------
    InputError
        When nothing is stored, or a level does not exist.
    """
    panes = thinned(panes_of_run(run, levels))
    panes = [with_strain(pane) for pane in panes] if strain else panes
    return PlayerFrame(player_page(panes, str(run.info.get("scene", "") or run.path.name)), width, height)
