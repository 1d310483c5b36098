"""`pdvol repair`: mend a mesh file into another one."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.errors import InputError


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol repair`."""
    parser.add_argument("mesh", type=Path, metavar="IN")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="OUT", help="the mended mesh, another file")
    lengths = {
        "weld": (1e-8, "join vertices that are nearer than this"),
        "hole": (1.0, "fill holes whose rim is no longer than this"),
        "envelope": (1e-3, "unite shells that cross, and change the surface by no more than this; 0: not"),
    }
    for name, (default, text) in lengths.items():
        parser.add_argument(
            f"--{name}",
            type=float,
            default=default,
            metavar="SHARE",
            help=f"{text}, in diagonals (default {default:g})",
        )


def main(options: Namespace) -> int:
    """Print each thing that was done, and the verdict; 0 where the result is sound, else 2."""
    for name in ("weld", "hole", "envelope"):
        if not 0.0 <= getattr(options, name) < float("inf"):
            raise InputError(f"--{name}: {getattr(options, name):g} is no fraction of the diagonal; 0 leaves it out")
    if options.out.resolve() == options.mesh.resolve():
        raise InputError(f"{options.out}: the input itself; give another file to write")
    from pdvol.runs.mending import mend_file

    lines, sound = mend_file(options.mesh, options.out, options.weld, options.hole, options.envelope)
    print("\n".join(lines))
    return 0 if sound else 2
