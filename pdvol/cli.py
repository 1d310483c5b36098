"""The command line. A user's mistake ends in one line and exit code 2, a simulation that cannot go on in one line and
exit code 1.
"""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from pdvol.errors import InputError, PdvolError, SimulationError
from pdvol.registry import FORMATS, INTERPOLANTS, METHODS


def main(scene: Callable | None = None, argv: Sequence[str] | None = None) -> None:
    """The `pdvol` command; with a scene function, `pdvol run` on the file that defines it (what demos end with). Exits."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if scene is not None:
        arguments = ["run", sys.modules[scene.__module__].__file__ or "", *arguments]
    sys.exit(run(arguments))


def run(arguments: Sequence[str]) -> int:
    """Carries out one command line; its exit code."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # names may hold what the terminal's encoding does not
    try:
        options = _parser().parse_args(arguments)
        return options.command(options) or 0
    except InputError as error:
        return _end(error, 2)
    except SimulationError as error:
        return _end(error, 1)
    except KeyboardInterrupt:
        return _end("interrupted; finished steps are kept, go on with --resume", 130)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # the reader of our output left; nothing more to say to it
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
    if _rank() == 0:
        print(f"pdvol: {' '.join(str(message).split())}", file=sys.stderr)
    return code


def _rank() -> int:
    mpi = sys.modules.get("mpi4py.MPI")
    return mpi.COMM_WORLD.rank if mpi else 0


def _abort_other_ranks() -> None:
    """An error that only one rank sees would leave the others waiting for ever."""
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi and mpi.COMM_WORLD.size > 1:
        import traceback

        traceback.print_exc()
        sys.stderr.flush()
        mpi.COMM_WORLD.Abort(1)


# ---- commands
# ----------------------------------------------------------------------------------------------------------------


def _run(options) -> None:
    from pdvol.runs.runner import run_scene

    shot = _shot(options)
    first, last = _levels(options.levels)
    out = options.out or Path("runs") / f"{shot.name}{'' if options.method == 'progressive' else '_' + options.method}"
    run_scene(
        shot,
        out,
        first,
        last,
        options.method,
        options.prolongation,
        options.resume,
        progress=_progress(),
        wavefront=options.wavefront,
    )
    _finish(out)


def _preview(options) -> None:
    from pdvol.runs.runner import run_scene

    shot = _shot(options)
    out = options.out or Path("runs") / f"{shot.name}_preview"
    run_scene(shot, out, 0, 0, resume=options.resume, progress=_progress())
    _finish(out)


def _refine(options) -> None:
    from pdvol.runs.runner import refine_run

    refine_run(options.run, options.to, progress=_progress(), wavefront=options.wavefront)
    _finish(options.run)


def _check(options) -> int:
    from pdvol.commands import preflight

    if options.measure < 0:
        raise InputError(f"--measure: {options.measure:g} seconds are too few; 0 measures nothing")
    if len(options.files) == 1 and options.files[0].suffix == ".py":
        from pdvol.runs.scene_file import load_shot, parse_settings

        shot = load_shot(options.files[0], parse_settings(options.set))
        result = preflight.check_scene(shot.scene, options.measure, options.out)
        lines = preflight.told(result)
    else:
        if options.out is not None:
            raise InputError("-o writes the levels of a scene; give one SCENE.py, or leave it out")
        result = preflight.check_meshes(options.files)
        lines = [entry["told"] for entry in result["files"]]
    if options.json is not None:
        preflight.write_result(result, options.json)
    print("\n".join(lines))
    return 0 if result["sound"] else 2


def _hierarchy(options) -> None:
    from pdvol.commands.inspection import write_hierarchy

    targets = tuple(_whole("--levels", word) for word in options.levels.split(","))
    print("\n".join(write_hierarchy(options.mesh, targets, options.out, options.prolongation)))


def _info(options) -> None:
    from pdvol.commands.inspection import describe_run, describe_shot

    if options.what.suffix == ".py":
        from pdvol.runs.scene_file import load_shot, parse_settings

        print("\n".join(describe_shot(load_shot(options.what, parse_settings(options.set)))))
    else:
        print("\n".join(describe_run(options.what, options.pictures)))


def _metrics(options) -> None:
    from pdvol.commands.inspection import describe_metrics
    from pdvol.commands.measuring import write_metrics

    result = write_metrics(options.run, options.against, options.json)
    print("\n".join([*describe_metrics(result), f"{options.run}: metrics.json and metrics.png"]))


def _render(options) -> None:
    from pdvol.draw.picture import render
    from pdvol.store.reader import open_run

    first, last = _levels(options.levels)
    run = open_run(options.run)
    levels = range(first, (len(run.levels) - 1 if last is None else last) + 1)
    out = options.out or options.run / "picture.png"
    print(render(run, out, levels=list(levels), turn=options.turn))


def _export(options) -> None:
    from pdvol.runs.exports import export_run
    from pdvol.store.reader import open_run

    first, last = _levels(options.levels)
    levels = None
    if options.levels:
        levels = range(first, (len(open_run(options.run).levels) - 1 if last is None else last) + 1)
    written, notes = export_run(options.run, options.format, options.out, levels)
    print("\n".join([*map(str, written), *notes]))


# ---- their parts
# -------------------------------------------------------------------------------------------------------------


def _shot(options):
    from pdvol.runs.scene_file import load_shot, parse_settings

    return load_shot(options.scene, parse_settings(options.set), options.steps)


def _levels(text: str) -> tuple[int, int | None]:
    """`0:2` and `1` as the first and last level, both included; all levels when empty."""
    if not text:
        return 0, None
    first, colon, last = text.partition(":")
    first_level = _whole("--levels", first or "0")
    return first_level, (_whole("--levels", last) if last else None) if colon else first_level


def _whole(name: str, text: str) -> int:
    if not text.strip().isdigit():
        raise InputError(f"{name}: {text!r} is not a whole number")
    return int(text)


def _progress():
    from pdvol.runs.progress import Progress

    return (lambda level, total, done: Progress(level, total, done=done)) if _rank() == 0 else None


def _finish(out: Path) -> None:
    """A picture, where to find things, and what contact held back; by one rank."""
    if _rank() != 0:
        return
    from pdvol.commands.inspection import held_back
    from pdvol.draw.picture import render
    from pdvol.store.reader import open_run

    run = open_run(out)
    picture = render(run, out / "picture.png")
    for line in (*(f"note: {line}" for line in run.info.get("mended", [])), *held_back(run)):
        print(line, file=sys.stderr)
    print(f"{out}: states, log.jsonl, level_N.xdmf and {picture.name}", file=sys.stderr)


class _Parser(argparse.ArgumentParser):
    """Tells a mistake in one line, as every other one is told."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see {self.prog} --help")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="pdvol", description="Preview soft-body animation coarse, refine it to the same animation, fine."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, work, text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.set_defaults(command=work)
        return sub

    def scene_options(sub, steps: bool = True) -> None:
        sub.add_argument(
            "--set",
            action="append",
            default=[],
            metavar="NAME=VALUE",
            help="a scene parameter, a solver setting, or a penalty's weight (consistency, weight)",
        )
        if steps:
            sub.add_argument("--steps", type=int, help="number of time steps, instead of the scene's")
            sub.add_argument("--out", type=Path, help="run folder (default: runs/NAME)")
            sub.add_argument("--resume", action="store_true", help="go on with the run in that folder")

    def prolongation_option(sub) -> None:
        sub.add_argument(
            "--prolongation",
            default="barycentric",
            choices=tuple(INTERPOLANTS),
            help="how a level's motion is carried to the next finer one",
        )

    def wavefront_option(sub) -> None:
        sub.add_argument("--wavefront", action="store_true", help="run the levels side by side, a process each")

    sub = command("run", _run, "simulate a scene's levels, coarse to fine")
    sub.add_argument("scene", type=Path, metavar="SCENE.py")
    sub.add_argument("--levels", default="", metavar="A:B", help="levels A to B, both included (default: all)")
    sub.add_argument(
        "--method",
        default="progressive",
        choices=tuple(METHODS),
        help="how finer levels are made (default: progressive)",
    )
    prolongation_option(sub)
    wavefront_option(sub)
    scene_options(sub)

    sub = command("preview", _preview, "simulate level 0 only")
    sub.add_argument("scene", type=Path, metavar="SCENE.py")
    scene_options(sub)

    sub = command("refine", _refine, "simulate the finer levels of a stored run")
    sub.add_argument("run", type=Path, metavar="RUN")
    sub.add_argument("--to", type=int, required=True, metavar="L", help="the finest level wanted")
    wavefront_option(sub)

    sub = command("check", _check, "pre-flight: what will be modelled, sizes, and every defect found")
    sub.add_argument("files", type=Path, nargs="+", metavar="SCENE.py | MESH")
    sub.add_argument(
        "-o",
        "--out",
        type=Path,
        metavar="DIR",
        help="write each level, and the primitives of every defect, there as VTU",
    )
    sub.add_argument("--json", type=Path, metavar="FILE", help="write the findings there, too")
    sub.add_argument(
        "--measure",
        type=float,
        default=3.0,
        metavar="SECONDS",
        help="simulate level 0 so long to tell costs (default 3; 0: not)",
    )
    scene_options(sub, steps=False)

    sub = command("hierarchy", _hierarchy, "build the levels of one mesh and report their bindings")
    sub.add_argument("mesh", type=Path, metavar="MESH")
    sub.add_argument("--levels", required=True, metavar="N,N,...", help="vertex targets, coarsest first")
    sub.add_argument("-o", "--out", type=Path, required=True, metavar="DIR")
    prolongation_option(sub)

    sub = command("info", _info, "what a scene will model, or what a run holds")
    sub.add_argument("what", type=Path, metavar="SCENE.py | RUN")
    sub.add_argument("--pictures", type=Path, metavar="DIR", help="draw a run's bindings there")
    scene_options(sub, steps=False)

    sub = command(
        "metrics",
        _metrics,
        "measure a run: continuity, consistency between levels, and more; writes metrics.json and metrics.png into it",
    )
    sub.add_argument("run", type=Path, metavar="RUN")
    sub.add_argument("--against", type=Path, metavar="RUN", help="another run of the same shot, to compare with")
    sub.add_argument("--json", type=Path, metavar="FILE", help="write the numbers there, too")

    sub = command("render", _render, "draw a run: rows are levels, columns are moments")
    sub.add_argument("run", type=Path, metavar="RUN")
    sub.add_argument("-o", "--out", type=Path, metavar="FILE.png|.mp4|.gif")
    sub.add_argument("--levels", default="", metavar="A:B")
    sub.add_argument("--turn", type=float, default=0.0, metavar="DEGREES", help="turn the camera about the vertical")

    sub = command(
        "export", _export, "write a run's levels for ParaView (xdmf, vtkhdf) or animation software (usd, obj)"
    )
    sub.add_argument("run", type=Path, metavar="RUN")
    sub.add_argument("--format", required=True, choices=tuple(FORMATS))
    sub.add_argument("-o", "--out", type=Path, required=True, metavar="DIR")
    sub.add_argument("--levels", default="", metavar="A:B", help="levels A to B, both included (default: all)")
    return parser
