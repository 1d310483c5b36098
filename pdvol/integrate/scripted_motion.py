"""What supports and obstacles prescribe on one level, and how far their motions were carried out.

Each motion has a clock of its own (`levels/clocks.py`): supports and obstacles that contact stops stay on their paths,
and go on from there as soon as they can. A step has one clock, which all motions follow that nothing stops. It ends
with each motion at its own time, or behind it.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from pdvol.geometry.poses import Pose
from pdvol.integrate.carriers import Carriers
from pdvol.levels.clocks import Clocks, Mover, lags_of, names_of
from pdvol.levels.model import HeldPoints, LevelModel
from pdvol.levels.obstacles import Obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.potential import Positions
from pdvol.solve.incremental_potential import IncrementalPotential

ON_TIME = 1e-9  # share of a step: a motion that is less late is on time, since times are sums with round-off


class ScriptedMotion:
    """The supports of a level, and the clocks of all motions.

    Parameters
    ----------
    clocks : those that obstacles in contact go by

    Attributes
    ----------
    held : (n_owned,) bool
        Vertices that supports hold in the present step.
    moves : bool
        Whether supports or obstacles are elsewhere at the end of the present step.
    moves_supports, moves_obstacles : bool
        Whether supports are, and whether obstacles are.
    clock : time [s] up to which motions have been carried out that were not stopped; motions that all set out late have
        one that sets out as late
    """

    def __init__(self, model: LevelModel, space: LevelSpace, clocks: Clocks | None = None):
        self._dt, self._start = model.dt, space.from_input(model.start)
        self._bodies, self._point_bodies = space.mesh.point_bodies[space.owned_points], space.mesh.point_bodies
        # Every rank moves all points of a support, so that a motion that fails does so on all ranks.
        self._supports = [_Owned(support, space) for support in model.supports]
        self._clocks = Clocks() if clocks is None else clocks
        self._names = names_of(model.supports, model.obstacles)
        self._clock, self._lags = 0.0, dict.fromkeys(self._names.values(), 0.0)
        self._holding: list[bool] | None = None
        self._moving: dict[str, Mover] = {}  # in the present step, by name
        self.begin(0.0)

    def begin(self, time: float) -> bool:
        """Starts the step at `time` [s]; returns whether other vertices are held than in the last one."""
        holding = [support.points.holds(time, self._dt) for support in self._supports]
        changed = holding != self._holding
        if changed:
            self._holding, self.held = holding, np.zeros(len(self._start), dtype=bool)
            for support in self._active():
                self.held |= support.mask
            held = [self._point_bodies[support.points.mask] for support in self._active()]
            self._held_bodies = frozenset(np.concatenate([*held, np.zeros(0, int)]).tolist())
        active = {support.points for support in self._active()}
        self._moving = {
            name: mover
            for name, mover in self._names.items()
            if (isinstance(mover, Obstacle) or mover in active)
            and mover.moves_between(time - self._lags[mover], time + self._dt)
        }
        self.moves = bool(self._moving)
        self.moves_obstacles = any(isinstance(mover, Obstacle) for mover in self._moving.values())
        self.moves_supports = any(not isinstance(mover, Obstacle) for mover in self._moving.values())
        lags = {mover: self._lags[mover] for mover in self._moving.values()}
        all_late = min(lags.values(), default=0.0)
        self._clock = time - all_late
        self._clocks.begin(self._clock, time + self._dt, {mover: lag - all_late for mover, lag in lags.items()})
        return changed

    @property
    def clock(self) -> float:
        return self._clock

    @clock.setter
    def clock(self, time: float) -> None:
        self._clock = time
        self._clocks.rewind(time)

    def end(self, time: float) -> tuple[float, float, dict[str, float]]:
        """Ends the step at `time` [s].

        Returns
        -------
        reached : the smallest share of its remaining motion that a support or obstacle has carried out
        behind : [s] how far it is behind the time, at most
        late : [s] the same of each that is, by its name; empty where all are equally far behind
        """
        moving, before = self._moving, self._lags
        self._lags = dict.fromkeys(self._names.values(), 0.0)
        shares = [1.0]
        for mover in moving.values():
            lag = time - self._clocks.of(mover, self.clock)
            self._lags[mover] = lag if lag > ON_TIME * self._dt else 0.0
            shares.append(max(0.0, round(1.0 - self._lags[mover] / (self._dt + before[mover]), 12)))
        lags = {name: self._lags[mover] for name, mover in moving.items()}
        late = {name: lag for name, lag in lags.items() if lag > 0.0} if len(set(lags.values())) > 1 else {}
        return min(shares), max(lags.values(), default=0.0), late

    def go_on_from(self, behind: float, late: Mapping[str, float]) -> None:
        """Sets what `end` gave."""
        self._lags = lags_of(behind, late, self._names)

    def going(self) -> list[Mover]:
        """What moves and has not been stopped in the present step."""
        return [mover for mover in self._moving.values() if not self._clocks.is_stopped(mover)]

    def stop(self, movers: Sequence[Mover]) -> None:
        """Stops some motions where they are, up to the end of the step."""
        self._clocks.stop(movers, self.clock)

    def release(self, movers: Sequence[Mover]) -> None:
        """Lets some motions go on that were stopped at the clock's present time."""
        self._clocks.release(movers)

    def _active(self) -> "list[_Owned]":
        return [support for support, holds in zip(self._supports, self._holding or [], strict=True) if holds]

    def positions(self, time: float) -> np.ndarray:
        """(n_owned, d) [m]: where held vertices should be at `time` [s]; those at t = 0 elsewhere."""
        target = self._start.copy()
        for support in self._active():
            own = self._clocks.of(support.points, time)
            target[support.mask] = support.points.at(own)[support.rows]
        return target

    def carriers(self, potential: IncrementalPotential, x: Positions, until: float) -> Carriers:
        """Who carries which body from x (at `clock`) while motions go on to `until` [s]. Collective."""
        nothing = np.zeros_like(x.owned)
        meet = lambda of: potential.closing(x, self.path(x, until, nothing, of), until)
        return Carriers(self._held_bodies, meet)

    def path(self, x: Positions, until: float, direction: np.ndarray, of: Mapping[int, Obstacle]) -> np.ndarray:
        """(n_owned, d) [m]: the way from x (at `clock`) to where supports hold vertices at `until` [s], for bodies that
        obstacles carry with these, for all others along direction (n_owned, d).
        """
        path = np.where(self.held[:, None], self.positions(until) - x.owned, direction)
        for carrier in set(of.values()):
            places = [carrier.at(self._clocks.of(carrier, time)) for time in (self.clock, until)]
            moved = Pose.fitted(*places)
            rows = np.isin(self._bodies, [body for body, by in of.items() if by is carrier])
            path[rows] = moved(x.owned[rows]) - x.owned[rows]
        return path


class _Owned:
    """A support with the part of it on this rank: mask (n_owned,) of owned vertices, and their rows in its points."""

    def __init__(self, points: HeldPoints, space: LevelSpace):
        self.points, self.mask = points, points.mask[space.owned_points]
        self.rows = np.cumsum(points.mask)[space.owned_points][self.mask] - 1
