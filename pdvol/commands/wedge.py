"""`pdvol wedge`: many variations of a scene on level 0."""

import shlex
import sys
import time
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from pdvol.commands.options import SHOT, WholeNumber, add, add_repeated, chosen_jobs, chosen_shot, number
from pdvol.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pdvol.studio.wedge.vary import Vary
    from pdvol.studio.wedge.wedge import Wedge

SEEK_RUNS = 200  # of a search: an evolution strategy in two to four parameters has settled by then
SEEK_BUDGET = 15.0  # minutes of a search
PRINT = "print"
EPILOG = """\
The folder DIR gets wedge.json, normal run folders DIR/0, DIR/1, ..., sheet.png and scatter.png. The same command goes
on with what is stored; another --vary adds variations. --executor print writes command lines for the scheduler of a
cluster and runs nothing; after they have run, the same command collects what is stored.
"""


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol wedge`."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    add(parser, *SHOT)
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR", help="folder of the wedge")
    text = "a setting and its values: A:B:N (N values from A to B), A:B (a range, with --sample or --seek) or a list,"
    add_repeated(parser, "--vary", "NAME=A:B:N", f"{text} 0,2,4; several make a grid")
    parser.add_argument(
        "--sample", action=WholeNumber, metavar="N", help="N variations that fill the ranges evenly, no grid"
    )
    parser.add_argument(
        "--jitter",
        type=number,
        metavar="SPEED",
        help="add a small random velocity [m/s] to each body's initial one, another in each variation",
    )
    parser.add_argument(
        "--seed", action=WholeNumber, default=0, metavar="N", help="of --sample and --seek (default: 0)"
    )
    add(parser, "--jobs")
    parser.add_argument("--executor", default="local", choices=("local", PRINT), help="of runs (default: local)")
    text = """the larger the better: 'upright("bear")', a function of a run in the scene file, or FILE.py:NAME"""
    add_repeated(parser, "--score", "TEXT", text)
    parser.add_argument("--sort", default="", metavar="NAME", help="a score, a parameter, cluster or number")
    parser.add_argument("--film", action="store_true", help="a film of all variations as well")
    parser.add_argument("--no-picture", action="store_true", help="do not draw sheet.png and scatter.png")
    parser.add_argument("--tiles", action="store_true", help="each picture of sheet.png as tiles/NUMBER.png as well")
    add(parser, "--facets")
    parser.add_argument("--seek", default="", metavar="TEXT", help="search the ranges for the largest score")
    parser.add_argument("--runs", action=WholeNumber, metavar="N", help=f"at most, of --seek (default: {SEEK_RUNS})")
    parser.add_argument(
        "--budget", type=number, metavar="MINUTES", help=f"at most, of --seek (default: {SEEK_BUDGET:g})"
    )
    parser.add_argument("--goal", type=number, metavar="SCORE", help="end --seek with the first score as large as this")


def main(options: Namespace) -> int:
    """Run the variations, or search; print the table; draw the sheet."""
    try:
        _make(options)
    except KeyboardInterrupt:
        print("pdvol: interrupted; what is stored is kept, the same command goes on with it", file=sys.stderr)
        return 130
    return 0


def _make(options: Namespace) -> None:
    from pdvol.studio.wedge.results import cell_text, draw_results, table_lines
    from pdvol.studio.wedge.scores import chosen_scores
    from pdvol.studio.wedge.vary import TAKEN, parsed_varies
    from pdvol.studio.wedge.wedge import Wedge

    jobs = chosen_jobs(options)
    _check_seek(options)
    shot, varies = chosen_shot(options), parsed_varies(options.vary, TAKEN)
    texts = [*([options.seek] if options.seek else []), *(text for text in options.score if text != options.seek)]
    wedge = Wedge.of(shot, options.out, chosen_scores(texts, shot))
    with wedge.taken():
        if options.seek:
            _seek(options, wedge, varies, jobs)
        elif not _run(options, wedge, varies, jobs):
            return
        entries = wedge.grouped(options.sort)
        wedge.write()
        files = draw_results(wedge, entries, not options.no_picture, options.film, options.tiles, options.facets)
    print("\n".join(table_lines(entries)), file=sys.stderr if options.executor == PRINT else sys.stdout)
    if wedge.best:
        best = wedge.best
        print(f"best: number {best['number']}, {best['of']} = {cell_text(best['score'])}", file=sys.stderr)
    print(f"{wedge.out}: {', '.join(file.name for file in (wedge.file, *files))}", file=sys.stderr)


def _check_seek(options: Namespace) -> None:
    if options.seek:
        if options.executor == PRINT:
            raise InputError("--seek needs its runs at once: leave out --executor print")
        if options.sample is not None or options.jitter is not None:
            raise InputError("--seek chooses its own variations; leave out --sample and --jitter")
    elif options.runs is not None or options.budget is not None or options.goal is not None:
        raise InputError("--runs, --budget and --goal are bounds of --seek")
    if options.budget is not None and not options.budget > 0.0:
        raise InputError(f"--budget {options.budget:g}: give minutes above zero")


def _run(options: Namespace, wedge: "Wedge", varies: "Sequence[Vary]", count: int) -> bool:
    """Make the runs, or print their command lines; whether all have ended."""
    from pdvol.studio.wedge.results import progress
    from pdvol.studio.wedge.vary import chosen_variations
    from pdvol.studio.workers import Workers

    sample = options.sample
    if varies or sample is not None or options.jitter is not None or not wedge.entries:
        wedge.add(chosen_variations(varies, sample, options.jitter, options.seed), options.vary)
    total = len(wedge.entries)
    if options.executor == PRINT:
        jobs = wedge.missing()
        for job in jobs:
            print(shlex.join(["pdvol", *job.command()]))
        if jobs:
            print(f"{len(jobs)} of {total} runs are missing; then the same command collects them", file=sys.stderr)
        return not jobs
    print(f"{total} runs, {min(count, total)} at a time", file=sys.stderr)
    with closing(Workers(count)) as workers, progress(total) as report:
        wedge.run(range(total), workers, report)
    return True


def _seek(options: Namespace, wedge: "Wedge", varies: "Sequence[Vary]", count: int) -> None:
    from pdvol.studio.wedge.results import progress
    from pdvol.studio.wedge.search import Until, seek_best
    from pdvol.studio.workers import Workers

    runs = SEEK_RUNS if options.runs is None else options.runs
    if runs < 1:
        raise InputError("--runs 0: give at least 1")
    deadline = time.monotonic() + 60.0 * (SEEK_BUDGET if options.budget is None else options.budget)
    goal = float("inf") if options.goal is None else options.goal
    with closing(Workers(count)) as workers, progress(runs, options.seek) as report:
        seek_best(wedge, options.seek, varies, workers, Until(runs, deadline, goal), options.seed, report)
