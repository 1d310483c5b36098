"""`pdvol info`: what a scene will model, or what a run holds."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import add_settings, loaded_shot


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol info`."""
    parser.add_argument("what", type=Path, metavar="SCENE.py | RUN")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="draw a run's bindings there")
    add_settings(parser)


def main(options: Namespace) -> None:
    """Print the lines of one scene or run."""
    if options.what.suffix in (".py", ".json"):
        shot = loaded_shot(options.what, options.set)
        from pdvol.runs.scene_summary import scene_summary

        print("\n".join(scene_summary(shot)))
    else:
        from pdvol.runs.run_summary import run_summary

        print("\n".join(run_summary(options.what, options.pictures)))
