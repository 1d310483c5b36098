"""`pdvol export`: a run's levels in the formats of other software."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import add, number, stored_levels
from pdvol.registry import FORMATS, SHOWN_SURFACES


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol export`."""
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("--format", required=True, choices=tuple(FORMATS))
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR")
    parser.add_argument(
        "--fps", type=number, help="frames a second, to which usd, pc2 and alembic resample (pc2: 24 without it)"
    )
    parser.add_argument("--fields", action="store_true", help="contact forces, strains and stresses in usd too")
    parser.add_argument(
        "--surface",
        choices=SHOWN_SURFACES,
        help="of bodies with a render mesh: that mesh (default), the simulated surface, or both",
    )
    parser.add_argument(
        "--no-crossings", action="store_true", help="do not look where render meshes cross, which may take longest"
    )
    add(parser, "--levels", "--trust")


def main(options: Namespace) -> None:
    """Export, and print the names of the files written."""
    from pdvol.store.reader import open_run
    from pdvol.studio.export.exports import export_run

    levels = stored_levels(options.levels, open_run(options.run))
    written, notes = export_run(
        options.run,
        options.format,
        options.out,
        levels,
        options.fps,
        options.fields,
        options.surface,
        not options.no_crossings,
    )
    print("\n".join([*map(str, written), *notes]))
