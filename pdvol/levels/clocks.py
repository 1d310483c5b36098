"""The clocks of scripted motions: each support and obstacle that moves has one of its own.

A step has one clock for all motions, which goes on from part to part. A motion that is on time follows it. One that
contact has stopped in this step stays where it is. One that was held back in an earlier step sets out late, and catches
up evenly, so that it is on time at the step's end if nothing stops it.
"""

from collections.abc import Iterable, Mapping, Sequence

from pdvol.levels.model import HeldPoints
from pdvol.levels.obstacles import Obstacle

Mover = Obstacle | HeldPoints
"""What a motion moves."""


class Clocks:
    """The times of motions at a time of the step's clock; without further ado all are on time."""

    def __init__(self) -> None:
        self._begin, self._end = 0.0, 1.0
        self._late: dict[Mover, float] = {}
        self._stopped: dict[Mover, tuple[float, float]] = {}  # the step's clock, and the motion's own

    def begin(self, begin: float, end: float, late: Mapping[Mover, float]) -> None:
        """A step's clock goes from `begin` to `end` [s]; some motions set out `late` [s]. None is stopped."""
        self._begin, self._end, self._stopped = begin, end, {}
        self._late = {mover: lag for mover, lag in late.items() if lag > 0.0}

    def of(self, mover: Mover, time: float) -> float:
        """[s]: the time of a motion when the step's clock shows `time` [s]."""
        if mover in self._stopped:
            return self._stopped[mover][1]
        late = self._late.get(mover, 0.0)
        return time - late * (self._end - time) / (self._end - self._begin) if late else time

    def stop(self, movers: Iterable[Mover], time: float) -> None:
        """Some motions stay from `time` [s] of the step's clock on."""
        self._stopped |= {mover: (time, self.of(mover, time)) for mover in movers}

    def is_stopped(self, mover: Mover) -> bool:
        """Whether a motion has been stopped in this step."""
        return mover in self._stopped

    def rewind(self, time: float) -> None:
        """The step's clock is put to `time` [s]: what was stopped after that is free again."""
        self._stopped = {mover: at for mover, at in self._stopped.items() if at[0] <= time}

    def release(self, movers: Iterable[Mover]) -> None:
        """Some motions that were stopped go on."""
        for mover in movers:
            self._stopped.pop(mover, None)


def names_of(supports: Sequence[HeldPoints], obstacles: Sequence[Obstacle]) -> dict[str, Mover]:
    """What moves in a scene, by its name in the log, as "support 0" or "obstacle 1"."""
    found: dict[str, Mover] = {f"support {i}": support for i, support in enumerate(supports) if support.moves}
    return found | {f"obstacle {i}": obstacle for i, obstacle in enumerate(obstacles) if obstacle.moves}


def lags_of(behind: float, late: Mapping[str, float], movers: Mapping[str, Mover]) -> dict[Mover, float]:
    """How far motions are behind the time [s], as a record of the log has it: all by `behind`, unless `late` names
    those that are.
    """
    if late:
        return {mover: float(late.get(name, 0.0)) for name, mover in movers.items()}
    return dict.fromkeys(movers.values(), float(behind))
