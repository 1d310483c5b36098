"""`pdvol info`: what a scene will model, or what a run holds."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import add, chosen_shot


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol info`."""
    parser.add_argument("what", type=Path, metavar="SCENE.py | RUN")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="draw a run's bindings there")
    add(parser, "--set")


def main(options: Namespace) -> None:
    """Print the lines of one scene or run."""
    if options.what.suffix in (".py", ".json"):
        shot = chosen_shot(options, options.what)
        from pdvol.runs.scene_summary import scene_summary

        print("\n".join(scene_summary(shot)))
    else:
        print("\n".join(_run_lines(options.what, options.pictures)))


def _run_lines(path: Path, pictures: Path | None) -> list[str]:
    """What a run folder holds; its bindings are drawn into the folder `pictures`, where one is given."""
    from pdvol.runs.run_summary import binding_lines, run_summary
    from pdvol.store.reader import open_run

    run = open_run(path)
    lines = run_summary(run)
    if len(run.levels) == 1 and pictures is None:
        return lines
    from pdvol.runs.stored_fields import stored_hierarchy  # loads finite elements

    hierarchy = stored_hierarchy(run)
    if pictures is not None:
        from pdvol.studio.draw.bindings import draw_bindings

        draw_bindings(hierarchy, pictures, run.info.get("up") or (0.0, 0.0, 1.0))
    return [*lines, *binding_lines(hierarchy)]
