"""The record of a hand: what it pulls, and where it has moved obstacles and supports, step by step of level 0.

A record is a file with a JSON object a line. Line n is step n, complete in itself:

    {"step": 7, "pulls": [{"number": 3, "body": "bunny", "place": [...], "point": [...]}], "obstacles": {"door": [...]}}

A pull holds the material at a place at rest [m], as placed, and draws it to a point [m]; presses have different
numbers. It may have a stiffness [N/m], and a grip [m]: how far the patch was from the point when it was taken.
Obstacles and supports have offsets [m] from their scripted motions, and lines of a live page the number `sample` of
what it had sent last. A record may grow while it is read.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.scene.checks import count, plain, positive, require, text, vector
from pdvol.scene.element import NOT_SIMULATED

FARTHEST = 1e9  # m: coordinates of a pull, whose squares and cubes are numbers


@dataclass(eq=False)
class Hand:
    """A record. Where there is no file yet, it has no line.

    Attributes
    ----------
    file : path
    channel : the file that has the present state of the hand, while level 0 is played; None of one that is replayed
    """

    file: Path
    channel: Path | None = field(default=None, metadata={NOT_SIMULATED: True})

    def __post_init__(self) -> None:
        self._lines, self._end = list[dict[str, Any]](), 0

    @property
    def steps(self) -> int:
        """The number of whole lines. Raises InputError where one is wrong."""
        try:
            with open(self.file, "rb") as file:
                file.seek(self._end)
                data = file.read()
        except FileNotFoundError:
            return len(self._lines)
        except OSError as error:
            raise InputError(f"{self.file} cannot be read: {error.strerror or error}") from error
        whole = data[: data.rfind(b"\n") + 1]
        self._end += len(whole)
        for line in whole.splitlines():
            self._lines.append(_parsed(line, f"{self.file}, line {len(self._lines) + 1}"))
        return len(self._lines)

    def line(self, step: int) -> dict[str, Any]:
        """What the hand does at the end of a step. Before the first line and after the last one it pulls nothing; what
        it has moved stays.
        """
        if step > len(self._lines) and step > self.steps:
            return {"pulls": [], "obstacles": self._lines[-1]["obstacles"] if self._lines else {}}
        return self._lines[step - 1] if step > 0 else {"pulls": [], "obstacles": {}}

    def keep(self, steps: int) -> None:
        """Has a line for each of so many steps, and no further ones; in those that are missing it does nothing."""
        kept = [self.line(step) | {"step": step} for step in range(1, steps + 1)]
        self.file.write_text("".join(f"{json.dumps(line)}\n" for line in kept))
        self.__post_init__()


def same_up_to(step: int, one: Hand | None, other: Hand | None) -> bool:
    """Whether two hands have done the same up to a step; none does nothing."""
    done = lambda hand, number: [hand.line(number)[key] for key in ("pulls", "obstacles")] if hand else [[], {}]
    return all(done(one, number) == done(other, number) for number in range(1, step + 1))


def _parsed(data: bytes, where: str) -> dict[str, Any]:
    try:
        line = json.loads(data)
        for pull in line["pulls"]:
            check_pull(pull)
        for name, offset in line["obstacles"].items():
            vector(f"the offset of {name!r}", plain(offset))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{where} is no line of a hand: {' '.join(str(error).split())}") from error
    return line


def check_pull(pull: Any) -> None:
    """InputError unless an entry of `pulls` has all that it needs, in finite numbers."""
    require(isinstance(pull, dict), "a pull must be a JSON object")
    count("number", pull.get("number"), 0)
    text("body", pull.get("body"))
    for name in ("place", "point"):
        vector(name, plain(pull.get(name)))
        require(max(map(abs, pull[name])) < FARTHEST, f"{name} = {pull[name]} is too far away")
    if "stiffness" in pull:
        positive("stiffness", pull["stiffness"])
    if "grip" in pull:
        vector("grip", plain(pull["grip"]))
        require(len(pull["grip"]) == len(pull["point"]), "grip and point differ in length")
