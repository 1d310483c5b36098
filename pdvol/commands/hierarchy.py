"""`pdvol hierarchy`: build the levels of one mesh."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import add, whole_number


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol hierarchy`."""
    parser.add_argument("mesh", type=Path, metavar="MESH")
    parser.add_argument("--levels", required=True, metavar="N,N,...", help="vertex targets, coarsest first")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR")
    add(parser, "--prolongation")


def main(options: Namespace) -> None:
    """Write the levels and pictures of their bindings, and print their sizes."""
    from pdvol.runs.mesh_hierarchy import write_hierarchy
    from pdvol.stages import stage
    from pdvol.studio.draw.bindings import draw_bindings

    targets = tuple(whole_number("--levels", word) for word in options.levels.split(","))
    hierarchy, lines = write_hierarchy(options.mesh, targets, options.out, options.prolongation)
    with stage("drawing the bindings"):
        draw_bindings(hierarchy, options.out)
    print("\n".join(lines))
