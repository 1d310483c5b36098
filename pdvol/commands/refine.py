"""`pdvol refine`: simulate the finer levels of a stored run."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import add_outputs, add_ranks, add_trust, add_wavefront, how


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol refine`."""
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("--to", type=int, required=True, metavar="L", help="the finest level wanted")
    add_wavefront(parser)
    add_ranks(parser)
    add_outputs(parser)
    add_trust(parser)


def main(options: Namespace) -> None:
    """Simulate, draw a picture and print where everything is. Collective."""
    from pdvol.commands.simulation import reported
    from pdvol.stages import stage

    with stage("loading the solver"):
        from pdvol.runs.runner import refine_run

    with reported(options.run, not options.no_picture, not options.no_xdmf):
        refine_run(options.run, options.to, **how(options))
