"""What a browser's hand does, as the file that a run by hand reads before each step."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError

REMARK = "hand: "  # how a run's line about a hand that it cannot follow begins
MOST_FINGERS = 10  # fingers


class Channel:
    """The hand of one take, as its browser sends it.

    Attributes
    ----------
    file : what the run reads
    """

    def __init__(self, file: Path):
        self.file = file
        self.hold([], {})

    def hold(self, pulls: Sequence[Mapping[str, Any]], obstacles: Mapping[str, Any], sample: int = 0) -> None:
        """Put this in place of what the hand held before.

        Parameters
        ----------
        pulls : `number` of the press, `body`, `place` at rest [m] and `point` [m] where it shall be
        obstacles : by name, the offset [m] from their motion
        sample : a number, which the record's lines have from then on

        Raises
        ------
        InputError
            A number is not finite, or something is missing.
        """
        if len(pulls) > MOST_FINGERS:
            raise InputError(f"a hand has {MOST_FINGERS} fingers, not {len(pulls)}")
        held = []
        for one in pulls:
            place, point = _point(one["place"]), _point(one["point"])
            held.append({"number": int(one["number"]), "body": str(one["body"]), "place": place, "point": point})
        moved = {str(name): _point(offset) for name, offset in obstacles.items()}
        aside = self.file.with_suffix(".aside")
        aside.write_text(json.dumps({"pulls": held, "obstacles": moved, "sample": int(sample) % 2**31}))
        os.replace(aside, self.file)


def _point(values: Any) -> list[float]:
    point = np.asarray(values, dtype=float)
    if point.shape not in ((2,), (3,)) or not np.isfinite(point).all():
        raise InputError("the hand: a place has two or three finite numbers")
    return [float(value) for value in point]
