"""What supports and obstacles prescribe on one level, and how far their motions were carried out.

All motions of a scene share one clock: supports and obstacles that contact stops stay on their paths, and go on from
there as soon as they can. A step ends with the clock at its own time, or `behind` it.
"""

import numpy as np

from pdvol.levels.model import HeldPoints, LevelModel
from pdvol.levels.space import LevelSpace


class ScriptedMotion:
    """The supports of a level, and the clock of all motions.

    Attributes
    ----------
    held : (n_owned,) bool
        Vertices that supports hold in the present step.
    moves : bool
        Whether supports or obstacles move in the present step.
    moves_obstacles : bool
        Whether an obstacle moves.
    clock : time [s] up to which motions have been carried out
    behind : [s] how far that is behind the end of the last step
    """

    def __init__(self, model: LevelModel, space: LevelSpace):
        self._dt, self._rest = model.dt, space.from_input(space.mesh.points)
        # Every rank moves all points of a support, so that a motion that fails does so on all ranks.
        self._supports = [_Owned(support, space) for support in model.supports]
        self.moves_obstacles = any(obstacle.moves for obstacle in model.obstacles)
        self.clock, self.behind = 0.0, 0.0
        self._holding: list[bool] | None = None
        self.begin(0.0)

    def begin(self, time: float) -> bool:
        """Starts the step at `time` [s]; returns whether other vertices are held than in the last one."""
        self.clock = time - self.behind
        holding = [support.points.holds(time, self._dt) for support in self._supports]
        changed = holding != self._holding
        if changed:
            self._holding, self.held = holding, np.zeros(len(self._rest), dtype=bool)
            for support in self._active():
                self.held |= support.mask
            self.moves = self.moves_obstacles or any(support.points.moves for support in self._active())
        return changed

    def end(self, time: float) -> float:
        """Ends the step at `time` [s]; returns the share of the remaining motion that it carried out."""
        before = self.behind
        self.behind = time - self.clock if self.moves else 0.0
        return max(0.0, round(1.0 - self.behind / (self._dt + before), 12))

    def _active(self) -> "list[_Owned]":
        return [support for support, holds in zip(self._supports, self._holding or [], strict=True) if holds]

    def positions(self, time: float) -> np.ndarray:
        """(n_owned, d) [m]: where held vertices should be at `time` [s]; rest positions elsewhere."""
        target = self._rest.copy()
        for support in self._active():
            target[support.mask] = support.points.at(time)[support.rows]
        return target


class _Owned:
    """A support with the part of it on this rank: mask (n_owned,) of owned vertices, and their rows in its points."""

    def __init__(self, points: HeldPoints, space: LevelSpace):
        self.points, self.mask = points, points.mask[space.owned_points]
        self.rows = np.cumsum(points.mask)[space.owned_points][self.mask] - 1
