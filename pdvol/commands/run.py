"""`pdvol run`: simulate a scene's levels into a run folder."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import (
    add_levels,
    add_new_run,
    add_picture,
    add_prolongation,
    add_wavefront,
    chosen_shot,
    level_range,
)
from pdvol.registry import METHODS


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol run`."""
    add_levels(parser)
    parser.add_argument(
        "--method",
        default="progressive",
        choices=tuple(METHODS),
        help="how finer levels are made (default: progressive)",
    )
    add_prolongation(parser)
    add_wavefront(parser)
    add_picture(parser)
    add_new_run(parser)


def main(options: Namespace) -> None:
    """Simulate, draw a picture and print where everything is. Collective."""
    from pdvol.commands.simulation import progress_report, report_run
    from pdvol.runs.runner import run_scene

    shot = chosen_shot(options)
    first, last = level_range(options.levels)
    name = shot.name if options.method == "progressive" else f"{shot.name}_{options.method}"
    out = options.out or Path("runs") / name
    run_scene(
        shot,
        out,
        first,
        last,
        options.method,
        options.prolongation,
        options.resume,
        progress=progress_report(),
        wavefront=options.wavefront,
    )
    report_run(out, not options.no_picture)
