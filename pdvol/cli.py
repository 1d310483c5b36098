"""The command line: a loop over the verbs of `pdvol.registry.COMMANDS`.

A user's mistake ends in one line and exit code 2, a simulation that cannot go on in one line and exit code 1.
"""

import argparse
import gc
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import NoReturn

from pdvol.commands.simulation import this_rank
from pdvol.errors import InputError, PdvolError, SeveralErrors, SimulationError
from pdvol.registry import COMMANDS
from pdvol.runs.known_scenes import trusting
from pdvol.runs.stage_lines import StageLines
from pdvol.stages import reported_to

GO_ON = dict.fromkeys(("run", "preview"), "go on with --resume")
GO_ON |= dict.fromkeys(("refine", "pick", "wedge", "study"), "the same command goes on")
"""How each verb that simulates goes on after an interrupt."""


def main(scene: Callable | None = None, argv: Sequence[str] | None = None) -> None:
    """The `pdvol` command, which ends the process with an exit code. A scene file that calls it whenever it is loaded
    is run once: only its call in the module "__main__" counts.

    Parameters
    ----------
    scene : a demo's scene function: `pdvol run` on the file that defines it
    argv : the words after `pdvol`; those of the process when None
    """
    if scene is not None and argv is None and sys._getframe(1).f_globals.get("__name__") != "__main__":
        return
    arguments = list(sys.argv[1:] if argv is None else argv)
    if scene is not None:
        arguments = ["run", sys.modules[scene.__module__].__file__ or "", *arguments]
    code = run(arguments)
    gc.freeze()  # at its end the interpreter would search all libraries' objects for garbage, for half a second
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Carry out one command line.

    Returns
    -------
    int
        0: done. 1: the simulation could not go on. 2: bad input. 130: interrupted.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # names may not fit the terminal's encoding
    try:
        options = parse(arguments)
        with reported_to(StageLines(rank=this_rank)), trusting(getattr(options, "trust", False)):
            return COMMANDS[options.command].main(options) or 0
    except InputError as error:
        return _end(error, 2)
    except SimulationError as error:
        return _end(error, 1)
    except KeyboardInterrupt:
        verb = next(iter(arguments), "")
        kept = f"; finished steps are kept, {GO_ON[verb]}" if verb in GO_ON else ""
        return _end(f"interrupted{kept}", 130)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # the reader of the output has ended
        return 0
    except PdvolError as error:
        return _end(error, 1)
    except OSError as error:
        if error.filename is None:
            _abort_other_ranks()
            raise
        return _end(f"{error.filename}: {error.strerror}", 2)
    except SystemExit:
        raise
    except BaseException:
        _abort_other_ranks()
        raise


def _end(message: object, code: int) -> int:
    if this_rank() == 0:
        for line in message.lines if isinstance(message, SeveralErrors) else (message,):
            print(f"pdvol: {' '.join(str(line).split())}", file=sys.stderr)
    return code


def _abort_other_ranks() -> None:
    """End all ranks: after an error on one of them the others would wait for ever."""
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi and mpi.COMM_WORLD.size > 1:
        import traceback

        traceback.print_exc()
        sys.stderr.flush()
        mpi.COMM_WORLD.Abort(1)


class _Parser(argparse.ArgumentParser):
    """Reports a mistake as every other one: in one line, with exit code 2."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see {self.prog} --help")


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """The options of one command line; `command` is its verb.

    Only the verb's own module is imported.

    Raises
    ------
    InputError
        There is no such verb, or its arguments are wrong.
    SystemExit
        After `--help`.
    """
    parser = _Parser(
        prog="pdvol", description="Preview soft-body animation coarse, refine it to the same animation, fine."
    )
    parser.add_argument("--version", action="version", version=f"pdvol {version('pdvol')}")
    verbs = parser.add_subparsers(required=True, metavar="COMMAND", dest="command")
    command = next((word for word in arguments if not word.startswith("-")), "")
    listed = [command] if command in COMMANDS else list(COMMANDS)  # listing all looks for verbs of other packages
    for name in listed:
        text = COMMANDS.help(name)
        verb = verbs.add_parser(name, help=text, description=text)
        if name == command:
            COMMANDS[name].add_arguments(verb)
    options, unknown = parser.parse_known_args(arguments)
    if unknown:
        raise InputError(f"unrecognized arguments: {' '.join(unknown)}; see pdvol {options.command} --help")
    return options
