"""`pdvol refine`: simulate the finer levels of a stored run."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import OUTPUTS, add


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol refine`."""
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("--to", type=int, required=True, metavar="L", help="the finest level wanted")
    add(parser, "--wavefront", "--ranks", *OUTPUTS, "--trust")


def main(options: Namespace) -> None:
    """Simulate, draw a picture and print where everything is. Collective."""
    from pdvol.commands.simulation import Outputs
    from pdvol.stages import stage

    with stage("loading the solver"):
        from pdvol.runs.runner import refine_run

    outputs = Outputs(options, options.run)
    outputs.simulate(refine_run, options.run, options.to)
    outputs.report()
