"""`pdvol pick`: one variation of a wedge as a run of its own, refined."""

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import OUTPUTS, WholeNumber, add
from pdvol.errors import InputError


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol pick`."""
    parser.add_argument("wedge", type=Path, metavar="DIR", help="folder of the wedge")
    parser.add_argument("number", metavar="NUMBER", help="of the variation, or best: what --seek has found")
    parser.add_argument("--refine", action="store_true", help="simulate the finer levels as well")
    parser.add_argument(
        "--to", action=WholeNumber, metavar="L", help="the finest level of --refine (default: the scene's)"
    )
    parser.add_argument("-o", "--out", type=Path, help="run folder (default: runs/NAME_pickNUMBER)")
    add(parser, "--wavefront", "--ranks", *OUTPUTS, "--trust")


def main(options: Namespace) -> None:
    """Copy the run, refine it, and print how far finer levels are from what was chosen, and whether scores hold."""
    from pdvol.commands.simulation import Outputs
    from pdvol.stages import stage

    with stage("loading the solver"):
        from pdvol.runs.known_scenes import allow, is_own_run
        from pdvol.runs.runner import refine_run
        from pdvol.runs.scene_file import stored_file, stored_shot
        from pdvol.store.folder import require_scene
        from pdvol.store.reader import open_run
        from pdvol.studio.wedge.pick import chosen_run, level_lines, take_out
        from pdvol.studio.wedge.scores import chosen_scores

    if options.to is not None and not options.refine:
        raise InputError("--to is the finest level of --refine; add --refine")
    source, entry = chosen_run(options.wedge, options.number)
    stored = open_run(source).info
    require_scene(source, stored)
    out = options.out or Path("runs") / f"{Path(stored['scene']).name}_pick{entry['number']}"
    file = stored_file(stored)
    if not (own := is_own_run(source, file)):
        allow(file, stored["parameters"], trusted=False)
    scores = chosen_scores(list(entry["scores"]), file, trusted=False)
    if options.refine:
        with stage(f"loading {file}"):
            finest = stored_shot(stored, own).scene.levels - 1
    take_out(source, out)
    outputs = Outputs(options, out)
    if options.refine:
        outputs.simulate(refine_run, out, finest if options.to is None else options.to)
    for line in level_lines(out, scores):
        print(line)
    if not options.refine:
        print(f"refine it by: pdvol refine {out}", file=sys.stderr)
        options.no_xdmf = True
    outputs.report()
