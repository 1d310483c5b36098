"""Where supports and obstacles are: each that moves has a time of its own on its path.

A span is a step or a part of one. Its clock goes from its begin to its end. A motion that is on time follows the clock.
One that contact stops waits. One that was stopped in an earlier span sets out late, and catches up evenly, so that it
is on time at the span's end if nothing stops it.

What waits stands still in the frame of the ground. With G(t) the ground's pose, what waits at its own time s is at

    G(t) G(s)^-1 x(s),    x(s) where its script has it at s.

Most scenes have no ground but their own frame, G = 1 (`obstacles.ground_of`).
"""

from collections.abc import Iterable, Mapping, Sequence
from copy import copy

import numpy as np

from pdvol.geometry.rigid_motions import Pose
from pdvol.levels.model import HeldPoints
from pdvol.levels.obstacles import ON_TIME, Obstacle, Place

Mover = Obstacle | HeldPoints
"""What a motion moves."""

UNMOVED = 1e-12  # relative difference of places that are the same: round-off of a pose and its inverse


class Script:
    """The places of movers at a time of a span's clock; before the first span all are on time.

    Parameters
    ----------
    supports, obstacles, ground : of a level, as `LevelModel` has them

    Attributes
    ----------
    movers : what moves, by its name in the log, as "support 0" or "obstacle 1"
    """

    def __init__(
        self,
        supports: Sequence[HeldPoints] = (),
        obstacles: Sequence[Obstacle] = (),
        ground: Sequence[Obstacle] = (),
    ) -> None:
        self.movers: dict[str, Mover] = {f"support {i}": s for i, s in enumerate(supports) if s.moves}
        self.movers |= {f"obstacle {i}": o for i, o in enumerate(obstacles) if o.moves}
        self._obstacles, self.ground = tuple(obstacles), tuple(ground)
        self.begin(0.0, 1.0, {})

    def begin(self, t0: float, t1: float, lags: Mapping[Mover, float]) -> None:
        """A span goes from t0 to t1 [s]; some motions set out late by their `lags` [s]. None is stopped."""
        self.t0, self.t1, self._stopped = t0, t1, dict[Mover, float]()
        self._late = {mover: lag for mover, lag in lags.items() if lag > 0.0}

    def at(self, time: float, lags: Mapping[Mover, float]) -> "Script":
        """The same movers at the beginning of another span, at `time` [s]."""
        other = copy(self)
        other.begin(time, time + 1.0, lags)
        return other

    def time_of(self, mover: Mover, clock: float) -> float:
        """[s]: a motion's own time when the span's clock shows `clock` [s]."""
        if mover in self._stopped:
            return self._stopped[mover]
        late = self._late.get(mover, 0.0)
        return clock - late * (self.t1 - clock) / (self.t1 - self.t0) if late else clock

    def lag(self, mover: Mover, clock: float) -> float:
        """[s]: how late a motion is; zero where that is round-off."""
        lag = clock - self.time_of(mover, clock)
        return lag if lag > ON_TIME * (self.t1 - self.t0) else 0.0

    def place(self, mover: Mover, clock: float) -> np.ndarray:
        """(k, d) [m]: the vertices of an obstacle, or the points of a support."""
        own = self.time_of(mover, clock)
        return self._carried(own, clock)(mover.at(own)) if self._waits(own, clock) else mover.at(own)

    def pose(self, plane: Obstacle, clock: float) -> Pose:
        """The pose of a plane."""
        own = self.time_of(plane, clock)
        return self._carried(own, clock) @ plane.pose(own) if self._waits(own, clock) else plane.pose(own)

    def moves(self, mover: Mover, own: float, until: float) -> bool:
        """Whether a mover whose own time is `own` [s] has to move with respect to the ground to be on time at `until`
        [s].
        """
        if not mover.moves:
            return False
        before, after = mover.at(own), mover.at(until)
        if not self.ground:
            return not np.array_equal(before, after)
        size = np.abs(after).max(initial=1.0)
        return bool(np.abs(self._carried(own, until)(before) - after).max(initial=0.0) > UNMOVED * size)

    def ground_moves(self, t0: float, t1: float) -> bool:
        """Whether the ground is elsewhere at t1 than at t0 [s]."""
        return any(not np.array_equal(ground.at(t0), ground.at(t1)) for ground in self.ground)

    def stop(self, movers: Iterable[Mover], clock: float) -> None:
        """Some motions wait from `clock` [s] on, up to the end of the span."""
        self._stopped |= {mover: self.time_of(mover, clock) for mover in movers}

    def is_stopped(self, mover: Mover) -> bool:
        """Whether a motion has been stopped in this span."""
        return mover in self._stopped

    def release(self, movers: Iterable[Mover]) -> None:
        """Some motions that were stopped go on."""
        for mover in movers:
            self._stopped.pop(mover, None)

    def recorded_lags(self, behind: float, late: Mapping[str, float]) -> dict[Mover, float]:
        """How late motions are [s], as a record of the log has it: all by `behind`, unless `late` names those that
        are.
        """
        return {mover: float(late.get(name, 0.0) if late else behind) for name, mover in self.movers.items()}

    def placed(self, time: float, lags: Mapping[Mover, float]) -> dict[Obstacle, Place]:
        """Where all obstacles are at `time` [s], late by their `lags` [s]."""
        self.begin(time, time + 1.0, lags)
        at = lambda o: self.pose(o, time) if o.kind == "plane" else self.place(o, time)
        return {obstacle: at(obstacle) for obstacle in self._obstacles}

    def _waits(self, own: float, clock: float) -> bool:
        """Whether what is late is not where its script had it at its own time."""
        return bool(self.ground) and own != clock

    def _carried(self, own: float, clock: float) -> Pose:
        """How the ground moves from a time to another one."""
        (ground,) = self.ground
        return ground.pose(clock) @ ground.pose(own).inverse
