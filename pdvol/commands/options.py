"""Options that several verbs share, and how their text is read."""

import sys
from argparse import Action, ArgumentParser, BooleanOptionalAction, Namespace
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdvol.commands.simulation import this_rank
from pdvol.errors import InputError
from pdvol.registry import INTERPOLANTS

if TYPE_CHECKING:
    from pdvol.runs.scene_file import Shot
    from pdvol.store.reader import Run


def whole_number(option: str, text: str) -> int:
    """The number that an option's text holds; InputError where it holds none."""
    if not text.strip().isdecimal():
        raise InputError(f"{option}: {text!r} is not a whole number")
    return int(text)


class WholeNumber(Action):
    """An option that takes a whole number; InputError for another text."""

    def __call__(self, parser: object, namespace: Namespace, values: Any, option_string: str | None = None) -> None:
        setattr(namespace, self.dest, whole_number(self.option_strings[0], values))


SHARED: dict[str, dict[str, Any]] = {
    "scene": {"type": Path, "metavar": "SCENE.py"},
    "--set": {
        "action": "append",
        "default": [],
        "metavar": "NAME=VALUE",
        "help": "a scene parameter, a solver setting, or what holds levels together (consistency, weight, feedback)",
    },
    "--steps": {"type": int, "help": "number of time steps, instead of the scene's"},
    "--resume": {"action": "store_true", "help": "go on with the run in that folder"},
    "--levels": {"default": "", "metavar": "A:B", "help": "levels A to B, both included (default: all)"},
    "--jobs": {"action": WholeNumber, "metavar": "N", "help": "runs at a time here (default: one per core)"},
    "--ranks": {
        "action": WholeNumber,
        "metavar": "N",
        "help": "MPI ranks a level (default: as many as its size pays for and cores are idle)",
    },
    "--wavefront": {
        "action": BooleanOptionalAction,
        "help": "run the levels side by side, a process each, or not (default: where it pays and cores are idle)",
    },
    "--prolongation": {
        "default": "barycentric",
        "choices": tuple(INTERPOLANTS),
        "help": "how a level's motion is carried to the next finer one",
    },
    "--facets": {"action": "store_true", "help": "draw bodies by their cells, not by their render meshes"},
    "--no-picture": {"action": "store_true", "help": "do not draw picture.png at the end"},
    "--no-xdmf": {"action": "store_true", "help": "do not write level_N.xdmf; pdvol export makes it later"},
    "--trust": {
        "action": "store_true",
        "help": "run the scene and the scores that a folder from elsewhere names; look at them before",
    },
}
"""Options of several verbs, by name, as `ArgumentParser.add_argument` takes them."""
ALIASES = {"--trust": ["--run-scene"]}
SHOT = ("scene", "--set", "--steps")  # for `chosen_shot`
OUTPUTS = ("--facets", "--no-picture", "--no-xdmf")  # for `simulation.Outputs`


def add(parser: ArgumentParser, *names: str) -> None:
    """Add options of `SHARED` to a verb."""
    for name in names:
        parser.add_argument(name, *ALIASES.get(name, ()), **SHARED[name])


def add_repeated(parser: ArgumentParser, name: str, metavar: str, text: str) -> None:
    """Add an option that may be given several times."""
    parser.add_argument(name, action="append", default=[], metavar=metavar, help=text)


def add_new_run(parser: ArgumentParser, ending: str = "") -> None:
    """The scene, its settings, and the run folder to write."""
    add(parser, *SHOT)
    parser.add_argument("-o", "--out", type=Path, help=f"run folder (default: runs/NAME{ending})")
    add(parser, "--resume")


def chosen_jobs(options: Namespace) -> int:
    """How many runs `--jobs` allows at a time; InputError where it is no number from 1 on."""
    from pdvol.processes import cores

    jobs = cores() if options.jobs is None else int(options.jobs)
    if jobs < 1:
        raise InputError("--jobs 0: give at least 1")
    return jobs


def level_range(text: str, option: str = "--levels") -> tuple[int, int | None]:
    """`0:2`, `1:`, `:1` and `1` as the first and last level, both included; the last is None where the text leaves it
    open.

    Raises
    ------
    InputError
        A level is not a whole number.
    """
    if not text:
        return 0, None
    first, colon, last = text.partition(":")
    begin = whole_number(option, first or "0")
    return begin, (whole_number(option, last) if last else None) if colon else begin


def stored_levels(text: str, run: "Run | None") -> Sequence[int] | None:
    """The levels of a stored run, or of each one of a wedge where that is None, that `--levels` names; None without the
    option. Raises as `level_range`.
    """
    if not text:
        return None
    first, last = level_range(text)
    if last is not None:
        return range(first, last + 1)
    if run is None:
        raise InputError("--levels: name the last level, too, for a wedge folder")
    return range(first, len(run.levels))


def number(text: str) -> float:
    """The number that an option's text holds, for `type` of an option; ValueError for "nan"."""
    value = float(text)
    if value != value:
        raise ValueError
    return value


def require_use(shot: "Shot", method: str) -> None:
    """InputError where `--set` gives a weight of the penalty that this method does not use."""
    from pdvol.scene.solver import WEIGHTS

    for name, user in WEIGHTS.items():
        if method != user and name in shot.parameters and getattr(shot.scene.penalty, name) > 0.0:
            raise InputError(f"--set {name}: only the method {user} uses it, not {method}; leave it out")


def chosen_shot(options: Namespace, file: Path | None = None) -> "Shot":
    """The scene of a file, `options.scene` when None, with `--set` and, where the verb has them, `--steps` and
    `--hand`. Loaded as a stage.

    Raises
    ------
    InputError
        The scene file or a setting is wrong.
    """
    from pdvol.stages import stage

    file = options.scene if file is None else file
    steps, hand, branch = (getattr(options, name, None) for name in ("steps", "hand", "branch"))
    with stage(f"loading {file}"):
        from pdvol.runs.fingerprint import not_compared
        from pdvol.runs.scene_file import load_shot, parse_settings, with_hand
        from pdvol.scene import Hand

        settings, usual = parse_settings(options.set), None
        if "dt" in settings and "steps" not in settings and steps is None and branch is None:
            with suppress(InputError):  # a scene may ask for it
                usual = load_shot(file, {name: settings[name] for name in settings if name != "dt"}).scene
        shot = load_shot(file, settings, steps)
        if hand is not None:
            if not hand.is_file():
                raise InputError(f"{hand}, what a hand did, is missing")
            shot = with_hand(shot, Hand(hand), Hand(hand).steps if steps is None else steps)
    unseen = "cannot be compared: a change of it goes unnoticed when the run goes on"
    notes = [f"{line} {unseen}" for line in not_compared(shot.description())]
    if usual is not None:
        count, dt, lasted = shot.scene.steps, shot.scene.dt, usual.steps * usual.dt
        mend = f"add --set steps={round(lasted / dt)} to keep that"
        if hand is not None:
            lasted, mend = count * usual.dt, "a hand has a line for each step"
        if abs(count * dt - lasted) >= 0.5 * dt:
            notes.append(f"{count} steps of {dt:g} s: the shot lasts {count * dt:g} s instead of {lasted:g} s; {mend}")
    for note in notes if this_rank() == 0 else ():
        print(f"note: {note}", file=sys.stderr)
    return shot
