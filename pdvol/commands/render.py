"""`pdvol render`: a picture or a film of a run."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import add_levels, stored_levels


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol render`."""
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("-o", "--out", type=Path, metavar="FILE.png|.mp4|.gif")
    add_levels(parser)
    parser.add_argument("--turn", type=float, default=0.0, metavar="DEGREES", help="turn the camera about the vertical")


def main(options: Namespace) -> None:
    """Draw, and print the file's name."""
    from pdvol.draw.picture import render
    from pdvol.store.reader import open_run

    run = open_run(options.run)
    out = options.out or options.run / "picture.png"
    print(render(run, out, levels=stored_levels(options.levels, run), turn=options.turn))
