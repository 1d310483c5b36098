"""`pdvol run`: simulate a scene's levels into a run folder."""

import sys
from argparse import SUPPRESS, ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from pdvol.commands.options import OUTPUTS, add, add_new_run, chosen_shot, level_range, require_use
from pdvol.commands.simulation import this_rank
from pdvol.errors import InputError
from pdvol.registry import METHODS

if TYPE_CHECKING:
    from pdvol.runs.scene_file import Shot


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol run`."""
    add(parser, "--levels")
    parser.add_argument("--to", dest="levels", default=SUPPRESS, type="0:{}".format, metavar="L", help="levels 0 to L")
    parser.add_argument(
        "--method", default="progressive", choices=METHODS, help="how finer levels are made (default: progressive)"
    )
    add(parser, "--prolongation", "--wavefront", "--ranks", *OUTPUTS)
    add_new_run(parser)
    parser.add_argument(
        "--branch",
        type=Path,
        metavar="RUN",
        help="begin with the stored states of another run, and go on from --at STEP with the settings given here",
    )
    parser.add_argument("--at", type=int, metavar="STEP", help="the last step taken over by --branch")
    parser.add_argument("--hand", type=Path, metavar="FILE", help="what a hand did: hand.jsonl of a take")
    parser.add_argument("--hand-from", type=Path, metavar="FILE", help=SUPPRESS)  # a live page's
    parser.add_argument("--accuracy", default="", metavar="LENGTH", help="settings of a study: 5mm or 1%% at the end")
    parser.add_argument("--time", default="", metavar="TIME", help="settings of a study: 90s or 10min of CPU time")
    parser.add_argument("--study", type=Path, metavar="DIR", help="the study to take them from")
    add(parser, "--trust")


def main(options: Namespace) -> None:
    """Simulate, draw a picture and print where everything is. Collective."""
    from pdvol.commands.simulation import Outputs
    from pdvol.stages import stage

    with stage("loading the solver"):
        from pdvol.runs.runner import run_scene

    shot = chosen_shot(options)
    first, last = level_range(options.levels)
    if options.accuracy or options.time or options.study:
        shot, first, last, options.method = _from_study(options, shot)
    name = shot.name if options.method == "progressive" else f"{shot.name}_{options.method}"
    out = options.out or Path("runs") / name
    if options.hand_from is not None:
        from pdvol.studio.live.player import played

        if options.hand is not None or options.method != "progressive" or first > 0:
            raise InputError("--hand-from plays level 0 of a progressive run; leave out --hand and --method")
        shot = played(shot, out, options.hand_from, options.steps)
    if not options.resume:
        require_use(shot, options.method)
    if options.branch is not None or options.at is not None:
        last, options.resume = _begin_branch(options, shot, first, last, out), True
    outputs, how = Outputs(options, out, shot.scene), (options.method, options.prolongation, options.resume)
    outputs.simulate(run_scene, shot, out, first, last, *how)
    outputs.report()


def _begin_branch(options: Namespace, shot: "Shot", first: int, last: int | None, out: Path) -> int:
    """Takes the stored states over; the finest level to go on with. Collective."""
    from mpi4py import MPI

    from pdvol.parallel import on_root
    from pdvol.runs.branch import branch_run

    if options.branch is None or options.at is None:
        raise InputError("--branch RUN and --at STEP go together")
    if options.resume or options.method != "progressive" or first > 0:
        raise InputError("--branch begins a new run, progressive and from level 0 on; leave out --resume, --method")
    finest = shot.scene.levels - 1 if last is None else last
    on_root(MPI.COMM_WORLD, lambda: branch_run(shot, options.branch, options.at, out, finest))
    return finest


def _from_study(options: Namespace, shot: "Shot") -> "tuple[Shot, int, int | None, str]":
    """The shot, levels and method that a study has found for the wanted accuracy or time."""
    from pdvol.studio.study.choice import choice_notes, chosen_point, with_point
    from pdvol.studio.study.conclusions import option_text
    from pdvol.studio.wedge.variation import length

    if bool(options.accuracy) == bool(options.time):
        raise InputError("--study needs --accuracy LENGTH or --time TIME, one of them")
    if options.study is None:
        option = f"--accuracy {options.accuracy}" if options.accuracy else f"--time {options.time}"
        raise InputError(f"{option} needs a study: pdvol study {options.scene} -o DIR, then add --study DIR")
    if options.levels or options.steps is not None:
        raise InputError("--levels and --steps come from the study here; leave them out")
    point = chosen_point(options.study, shot, options.accuracy, options.time)
    if this_rank() == 0:
        print(
            f"{option_text(point)}: {length(point['errors']['end'])} from the study's reference,"
            f" {point['cost']['cpu']:.3g} s of CPU time there",
            file=sys.stderr,
        )
        for note in choice_notes(options.study, point):
            print(note, file=sys.stderr)
    words = point["words"]
    first, last = level_range(words[words.index("--levels") + 1])
    return with_point(shot, point), first, last, point["method"]
