"""`pdvol preview`: simulate level 0 of a scene."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import add_new_run, add_outputs, chosen_shot

PREVIEW = "_preview"
"""What the default run folder has after the scene's name."""


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol preview`."""
    add_new_run(parser, PREVIEW)
    add_outputs(parser)


def main(options: Namespace) -> None:
    """Simulate level 0, draw a picture and print where everything is. Collective."""
    from pdvol.commands.simulation import progress_report, report_run
    from pdvol.stages import stage

    with stage("loading the solver"):
        from pdvol.runs.runner import run_scene

    shot = chosen_shot(options)
    out = options.out or Path("runs") / f"{shot.name}{PREVIEW}"
    run_scene(shot, out, 0, 0, resume=options.resume, progress=progress_report(), xdmf=not options.no_xdmf)
    report_run(out, not options.no_picture, not options.no_xdmf)
