"""`python -m pdvol.worker [MODULE ...]`: carries out command lines one after the other, so that libraries are loaded
once: these modules, or what every run imports.

Each line of standard input is a JSON object {"words": [...], "log": path}: the words after `pdvol`, and the file that
takes what the command prints. Each line of standard output is {"code": exit code}; the first one, {"ready": process
id}, says that all libraries are loaded. The end of standard input ends the process.
"""

import gc
import importlib
import json
import os
import resource
import signal
import sys
import traceback
from typing import TextIO

LOADED_BEFORE = ("pdvol.runs.runner", "pdvol.potentials.build")
INTERRUPTED = 130  # exit code of a command line that was requested to end, as `pdvol.cli` gives it
MOST_MEMORY = 2_000_000  # kilobytes of peak memory after which the process ends: another one then starts small


def main() -> None:
    """Carry out lines until standard input ends, or the process has become large."""
    from pdvol.cli import run

    inherited = _peak_memory()  # Linux counts that of the process which has started this one
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # between commands there is nothing to interrupt
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    with open(os.devnull) as nothing:
        commands = os.fdopen(os.dup(0))
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)  # what a library prints between two commands is no answer
    for module in sys.argv[1:] or LOADED_BEFORE:
        importlib.import_module(module)
    _answer(answers, {"ready": os.getpid()})
    for line in commands:
        command = json.loads(line)
        with open(command["log"], "w") as log:
            _redirect(log.fileno())
            try:
                signal.signal(signal.SIGINT, signal.default_int_handler)
                code = run(command["words"])
            except KeyboardInterrupt:  # at the last moment
                code = INTERRUPTED
            except SystemExit as end:
                code = end.code if isinstance(end.code, int) else 1
            except Exception:
                traceback.print_exc()
                code = 1
            finally:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
                sys.stdout.flush()
                sys.stderr.flush()
        gc.collect()  # PETSc's objects end with Python's
        _answer(answers, {"code": code})
        if _peak_memory() > max(MOST_MEMORY, inherited):
            return


def _peak_memory() -> int:
    """[kilobytes]"""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _answer(answers: TextIO, answer: dict) -> None:
    answers.write(json.dumps(answer) + "\n")


def _redirect(file: int) -> None:
    os.dup2(file, 1)
    os.dup2(file, 2)


if __name__ == "__main__":
    main()
