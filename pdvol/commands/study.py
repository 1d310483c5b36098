"""`pdvol study`: measure what a scene's settings cost, and what they give."""

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from pdvol.commands.options import SHOT, add, add_repeated, chosen_jobs, chosen_shot, level_range, number
from pdvol.errors import InputError

if TYPE_CHECKING:
    from pdvol.studio.wedge.variation import Variation

BUDGET = 10.0  # minutes: enough for the scenes in demos/ on their coarse levels


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol study`."""
    add(parser, *SHOT)
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR", help="folder of the study")
    text = (
        "what to vary: dt, integrator, elements, feedback, tolerance, dhat, level, friction.iterations, linear_rtol, or"
        " a setting with values, NAME=value,value,... or NAME=A:B:N; may be repeated (default:"
        " dt,integrator,elements,tolerance,dhat,level)"
    )
    add_repeated(parser, "--vary", "NAMES", text)
    parser.add_argument(
        "--reference", default="", metavar="NAME=VALUE,...", help="settings of the reference (default: by the budget)"
    )
    parser.add_argument("--budget", type=number, default=BUDGET, metavar="MINUTES", help=f"default: {BUDGET:g}")
    add(parser, "--jobs")
    parser.add_argument("--method", default="", choices=("progressive", "direct"), help="of the scene's own settings")
    add(parser, "--levels")


def main(options: Namespace) -> None:
    """Run the study, write study.json and study.html, print the sentences."""
    from pdvol.stages import stage
    from pdvol.studio.study.axes import chosen_axes
    from pdvol.studio.study.page import write_page
    from pdvol.studio.study.study import Study

    if not options.budget > 0.0:
        raise InputError(f"--budget {options.budget:g}: give minutes above zero")
    jobs = chosen_jobs(options)
    shot = chosen_shot(options)
    first, last = level_range(options.levels)
    if first != 0:
        raise InputError("--levels: a study begins with level 0; write 0:B")
    method = options.method or "progressive"
    chosen = chosen_axes(options.vary, shot)
    reference = _reference(options.reference, method)
    finest = shot.scene.levels - 1 if options.levels and last is None else last
    made = Study(shot, options.out, chosen, method, finest, reference, 60.0 * options.budget, jobs)
    result = made.run(lambda line: print(line, file=sys.stderr, flush=True))
    with stage("writing study.html"):
        page = write_page(made.out / "study.html", result)
    for sentence in result.get("sentences", ["no reference was finished; go on with a larger --budget"]):
        print(sentence)
    print(f"{made.out}: study.json and {page.name}")


def _reference(text: str, method: str) -> "Variation | None":
    from pdvol.runs.scene_file import parse_settings
    from pdvol.studio.wedge.variation import Variation

    if not text:
        return None
    changes = parse_settings(text.split(","))
    return Variation.of(changes, str(changes.pop("method", method)))
