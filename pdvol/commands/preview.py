"""`pdvol preview`: simulate level 0 of a scene."""

import sys
import time
from argparse import ArgumentParser, Namespace
from functools import partial
from pathlib import Path

from pdvol.commands.options import OUTPUTS, add, add_new_run, chosen_shot, require_use
from pdvol.errors import InputError, PdvolError

PREVIEW = "_preview"
"""What the default run folder has after the scene's name."""
LOOK = 0.03  # s between two looks at the files of a scene that is watched: less than a picture takes


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol preview`."""
    add_new_run(parser, PREVIEW)
    add(parser, *OUTPUTS, "--ranks")
    parser.add_argument("--watch", action="store_true", help="preview again whenever the scene file is saved")


def main(options: Namespace) -> None:
    """Simulate level 0, draw it and print where everything is; with `--watch` until interrupted. Collective."""
    if not options.watch:
        _preview(options)
        return
    if options.resume:
        raise InputError("--watch previews anew at each save; leave out --resume")
    from mpi4py import MPI

    if MPI.COMM_WORLD.size > 1:
        raise InputError("--watch works on one rank; leave out mpirun")
    try:
        while True:
            before = _sources(options.scene)
            try:
                _preview(options)
            except PdvolError as error:
                print(f"pdvol: {error}", file=sys.stderr)
            print(f"watching {options.scene}; stop with Ctrl-C", file=sys.stderr)
            last = before  # until they have changed and were alike in two looks: a save empties a file, then fills it
            while (now := _sources(options.scene)) == before or now != last:
                last = now
                time.sleep(LOOK)
    except KeyboardInterrupt:
        return


def _preview(options: Namespace) -> None:
    """One preview, which replaces the one that its folder holds, but with `--resume`."""
    from pdvol.commands.simulation import Outputs
    from pdvol.stages import stage

    with stage("loading the solver"):
        from pdvol.runs.runner import run_scene

    shot = chosen_shot(options)
    if not options.resume:
        require_use(shot, "progressive")
    out = options.out or Path("runs") / f"{shot.name}{PREVIEW}"
    outputs = Outputs(options, out, shot.scene)
    level_0 = partial(run_scene, shot, out, 0, 0, resume=options.resume)
    outputs.simulate(level_0, replace=not options.resume)
    outputs.report()


def _sources(scene: Path) -> dict[Path, int]:
    """Times of the last change [ns] of the Python files in the scene's folder, which it may import."""
    found = {}
    for file in {scene, *scene.parent.glob("*.py")}:
        try:
            found[file] = file.stat().st_mtime_ns
        except FileNotFoundError:  # between the two steps of an editor's save
            continue
    return found
