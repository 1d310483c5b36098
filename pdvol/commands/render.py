"""`pdvol render`: a picture or a film of a run."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import add, level_range, number, stored_levels, whole_number
from pdvol.errors import InputError


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol render`."""
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("-o", "--out", type=Path, metavar="FILE.png|.mp4|.gif|.webp")
    add(parser, "--levels")
    parser.add_argument(
        "--turn", type=number, default=0.0, metavar="DEGREES", help="turn the camera about the vertical"
    )
    parser.add_argument("--size", default="", metavar="WxH", help="pixels of the whole file, as 1920x1080")
    parser.add_argument("--fps", type=number, help="frames a second of a film, which plays at real speed")
    parser.add_argument("--frames", default="", metavar="A:B", help="steps A to B, both included (default: all)")
    parser.add_argument(
        "--camera",
        default="",
        metavar="VIEW",
        help="front, side, top, three-quarter, follow:BODY, or position and target in metres, X,Y,Z:TX,TY,TZ",
    )
    add(parser, "--facets")
    parser.add_argument(
        "--cut",
        default="",
        metavar="AXIS=PLACE[:NAME,...]",
        help="take away what lies before a plane, as z=0.1, of all bodies or of these bodies and obstacles",
    )


def main(options: Namespace) -> None:
    """Draw, and print the file's name."""
    from pdvol.store.reader import open_run
    from pdvol.studio.draw.picture import render
    from pdvol.studio.draw.views import Shot

    run = open_run(options.run)
    out = options.out or options.run / "picture.png"
    shot = Shot(
        view=options.camera,
        turn=options.turn,
        cut=options.cut,
        facets=options.facets,
        size=_size(options.size),
        fps=options.fps,
        span=level_range(options.frames, "--frames"),
    )
    print(render(run, out, stored_levels(options.levels, run), shot=shot))


def _size(text: str) -> tuple[int, int] | None:
    """`1920x1080` as width and height; None for an empty text."""
    if not text:
        return None
    width, cross, height = text.lower().partition("x")
    if not cross:
        raise InputError(f"--size: {text!r} is no width and height; give both, as 1920x1080")
    return whole_number("--size", width), whole_number("--size", height)
