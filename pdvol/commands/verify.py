"""`pdvol verify`: check every stored state, independently of the solver."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.errors import InputError

LISTED_PROBLEMS = 5  # lines for one level


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol verify`."""
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN")
    parser.add_argument(
        "--every", type=int, default=1, metavar="N", help="check every N-th state and the last one (default: 1)"
    )


def main(options: Namespace) -> int:
    """Print the findings of each run; 0 where all states are sound, 1 where a state is not or a file is damaged."""
    if options.every < 1:
        raise InputError(f"--every: {options.every} is too small; 1 checks every state")
    for path in options.runs:
        if not (path / "run.json").is_file():
            reason = "is not a run folder: it has no run.json" if path.is_dir() else "does not exist"
            raise InputError(f"{path} {reason}")
    sound = [_is_sound(path, options.every) for path in options.runs]
    return 0 if all(sound) else 1


def _is_sound(path: Path, every: int) -> bool:
    """Check one run and print its findings."""
    from pdvol.measure.verify import check_levels
    from pdvol.stages import say, stage

    print(path)
    sound = True
    try:
        levels = check_levels(path, every, say)
        while True:
            with stage(f"verifying {path}"):
                level = next(levels, None)
            if level is None:
                break
            print(f"  {level.summary()}", flush=True)
            for problem in level.problems[:LISTED_PROBLEMS]:
                print(f"    {problem}")
            if len(level.problems) > LISTED_PROBLEMS:
                print(f"    and {len(level.problems) - LISTED_PROBLEMS} more")
            sound = sound and not level.problems
    except InputError as error:
        print(f"  damaged: {error}")
        return False
    return sound
