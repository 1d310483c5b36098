"""The command of a study: its options, one line for a mistake, and rows that are measured and tabled one by one."""

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from typing import Any

from benchmarks.common.process import Failure, Mistake
from pdvol.errors import PdvolError

Body = Callable[[argparse.Namespace], int | None]
Cells = Callable[[Any, dict], list[list[str]]]


def command(name: str, doc: str | None, options: Mapping[str, Mapping]) -> Callable[[Body], Callable[..., int]]:
    """Makes a function of its options the command of the study `name`, described by the first line of `doc`.

    The command takes the words of the command line and returns the exit code: that of the function, 0 for None, 1
    after a failure, or 2 after a mistake of the user's. `options` are the arguments of `add_argument` by word.
    """

    def made(body: Body) -> Callable[..., int]:
        @wraps(body)
        def main(words: list[str] | None = None) -> int:
            described = (doc or "").partition("\n")[0]
            parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}", description=described)
            for word, more in options.items():
                parser.add_argument(*word.split(), **more)
            try:
                return body(parser.parse_args(words)) or 0
            except (Mistake, PdvolError, OSError) as error:
                print(f"benchmarks.{name}: {error}", file=sys.stderr)
                return 1 if isinstance(error, Failure) else 2

        return main

    return made


def each(names: Iterable, measure: Callable[[Any], dict], cells: Cells) -> list[list[str]]:
    """The cells of a table: those of each row's record, printed to standard error as soon as it is measured."""
    lines: list[list[str]] = []
    for name in names:
        mine = cells(name, measure(name))
        print(*(" | ".join(line) for line in mine), sep="\n", file=sys.stderr, flush=True)
        lines += mine
    return lines
