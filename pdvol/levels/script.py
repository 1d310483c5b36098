"""What moves on a script, obstacles and the vertices that supports hold, and where it is: each has a time of its own on
its path.

A span is a step or a part of one. Its clock goes from its begin to its end. A motion that is on time follows the clock.
One that contact stops waits. One that was stopped in an earlier span sets out late, and catches up evenly, so that it
is on time at the span's end if nothing stops it.

What waits stands still in the frame of the ground. With G(t) the ground's pose, what waits at its own time s is at

    G(t) G(s)^-1 x(s),    x(s) where its script has it at s.

Most scenes have no ground but their own frame, G = 1 (`obstacles.ground_of`).
"""

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from pdvol.geometry.rigid_motions import Pose
from pdvol.scene import Motion, Still, keeps_shape, moved

ON_TIME = 1e-9  # relative difference of times, poses and places that are the same: they are sums with round-off

Place = Pose | np.ndarray
"""Where an obstacle is: the pose of a plane, the vertices (k, d) [m] of others."""


@dataclass(frozen=True, eq=False, repr=False)
class Obstacle:
    """An obstacle of a scene.

    Attributes
    ----------
    kind : "plane", "mesh" (a surface in 3D) or "polyline" (in 2D)
    vertices : (k, d) [m]
        At rest. Of a plane: a point on it, and from there the ends of its unit normal and of d - 1 unit tangents.
    edges, faces : (e, 2) and (f, 3) int
        None of a plane; no faces in 2D.
    motion : (X, t) -> x
    closed : whether a surface or polyline encloses a volume
    opacity : how pictures draw a surface, above 0 and at most 1
    """

    name: str
    kind: str
    vertices: np.ndarray
    edges: np.ndarray
    faces: np.ndarray
    motion: Motion = Still()
    closed: bool = True
    opacity: float = 1.0

    @property
    def moves(self) -> bool:
        """Whether the scene gives it a motion."""
        return not isinstance(self.motion, Still)

    @property
    def rigid(self) -> bool:
        """Whether its motion is known to keep its shape."""
        return keeps_shape(self.motion)

    @property
    def label(self) -> str:
        """Its name in messages, as in "plane 'floor'"."""
        return f"{'plane' if self.kind == 'plane' else 'obstacle'} {self.name!r}"

    def at(self, time: float) -> np.ndarray:
        """(k, d) [m]: its vertices at `time` [s]. Raises InputError where a motion of the user's own fails."""
        return moved(self.motion, self.vertices, time, self.label)

    def pose(self, time: float) -> Pose:
        """The pose of a plane at `time` [s]."""
        if not self.moves:
            return Pose(np.eye(self.vertices.shape[1]), np.zeros(self.vertices.shape[1]))
        return Pose.of_frame(self.vertices, self.at(time))

    def plane_at(self, at: float | Pose) -> tuple[np.ndarray, np.ndarray]:
        """Point (d,) [m] and unit normal (d,) of a plane at a time [s] or pose."""
        pose, (point, end) = at if isinstance(at, Pose) else self.pose(at), self.vertices[:2]
        return pose(point), pose.rotation @ (end - point)

    def place(self, time: float) -> Place:
        """Where its motion has it at `time` [s]."""
        return self.pose(time) if self.kind == "plane" else self.at(time)

    def stored(self, at: Place) -> dict[str, np.ndarray]:
        """A place as run folders store it: `point` and `normal` of a plane, `vertices` of others."""
        if isinstance(at, Pose):
            point, normal = self.plane_at(at)
            return {"point": point, "normal": normal}
        return {"vertices": at}

    def __repr__(self) -> str:
        return f"Obstacle({self.name!r}, {self.kind}, {len(self.vertices)} vertices)"


@dataclass(frozen=True, eq=False)
class HeldPoints:
    """The vertices that a support holds.

    Attributes
    ----------
    mask : (n,) bool
    points : (k, d) [m]
        Where they are at t = 0.
    motion : (X, t) -> x
    release : time [s]
    """

    mask: np.ndarray
    points: np.ndarray
    motion: Motion
    release: float

    @property
    def moves(self) -> bool:
        """Whether they follow a motion."""
        return not isinstance(self.motion, Still)

    def holds(self, time: float, dt: float) -> bool:
        """Whether a step of dt [s] from `time` [s] on holds them; times are compared to a millionth of a step."""
        return time < self.release - 1e-6 * dt

    def at(self, time: float) -> np.ndarray:
        """(k, d) [m]: where they are at t = 0, and should be later. Raises InputError where an own motion fails."""
        return moved(self.motion, self.points, time, "a support") if self.moves and time > 0.0 else self.points


Mover = Obstacle | HeldPoints
"""What a motion moves."""


class Script:
    """The places of movers at a time of a span's clock; before the first span all are on time.

    Parameters
    ----------
    supports, obstacles, ground : of a level, as `LevelModel` has them

    Attributes
    ----------
    movers : what moves, by its name in the log, as "support 0" or "obstacle 1"
    supports, obstacles, ground : as given
    """

    def __init__(
        self, supports: Sequence[HeldPoints] = (), obstacles: Sequence[Obstacle] = (), ground: Sequence[Obstacle] = ()
    ) -> None:
        self.movers: dict[str, Mover] = {f"support {i}": s for i, s in enumerate(supports) if s.moves}
        self.movers |= {f"obstacle {i}": o for i, o in enumerate(obstacles) if o.moves}
        self.supports, self.obstacles, self.ground = tuple(supports), tuple(obstacles), tuple(ground)
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
        """Whether a mover whose own time is `own` [s] has to move against the ground to be on time at `until` [s]."""
        if not mover.moves:
            return False
        before, after = mover.at(own), mover.at(until)
        if not self.ground:
            return not np.array_equal(before, after)
        size = np.abs(after).max(initial=1.0)
        return bool(np.abs(self._carried(own, until)(before) - after).max(initial=0.0) > ON_TIME * size)

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
        """How late motions are [s], as the log records it: all by `behind`, unless `late` names those that are."""
        return {mover: float(late.get(name, 0.0) if late else behind) for name, mover in self.movers.items()}

    def placed(self, time: float, lags: Mapping[Mover, float]) -> dict[Obstacle, Place]:
        """Where all obstacles are at `time` [s], late by their `lags` [s]."""
        self.begin(time, time + 1.0, lags)
        at = lambda o: self.pose(o, time) if o.kind == "plane" else self.place(o, time)
        return {obstacle: at(obstacle) for obstacle in self.obstacles}

    def _waits(self, own: float, clock: float) -> bool:
        """Whether what is late is not where its script had it at its own time."""
        return bool(self.ground) and own != clock

    def _carried(self, own: float, clock: float) -> Pose:
        """How the ground moves from a time to another one."""
        (ground,) = self.ground
        return ground.pose(clock) @ ground.pose(own).inverse
