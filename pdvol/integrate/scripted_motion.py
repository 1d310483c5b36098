"""What a scene prescribes on one level: who is held when, where supports should be, and how far the motions were
followed.

All motions of a scene run on one clock, so that what contact stops (obstacles as well as supports) is at a place of its
motion, and moves on from there as soon as it can. A step ends with the clock at its own time, or `behind` it.
"""

import numpy as np

from pdvol.levels.scene_fields import supported_points
from pdvol.levels.space import LevelSpace
from pdvol.scene import Scene, Still, moved


class Script:
    """The supports of a level, and its clock.

    Attributes
    ----------
    held : (n_owned,) bool
        Vertices that supports hold in the present step.
    moves : bool
        Whether anything, supports or obstacles, is in motion in the present step.
    pushes : bool
        Whether an obstacle is.
    clock : time [s] up to which motions have been carried out
    behind : [s] how far that is behind the end of the last step
    """

    def __init__(self, scene: Scene, space: LevelSpace, level: int):
        self._scene, self._rest = scene, space.from_input(space.mesh.points)
        self._supports = []
        for support in scene.supports:
            held = supported_points(scene, support, space.mesh, level)
            mine = held[space.owned_points]
            # Every rank moves all of a support's points, so that a motion that fails does so on all of them.
            self._supports.append(
                (mine, np.cumsum(held)[space.owned_points][mine] - 1, space.mesh.points[held], support)
            )
        self.clock, self.behind = 0.0, 0.0
        self._holding: list[bool] | None = None
        self.begin(0.0)

    def begin(self, time: float) -> bool:
        """Sets out from `time` [s], where a step begins; says whether other vertices are held than in the last one."""
        self.clock = time - self.behind
        holding = [support.holds(time, self._scene.dt) for *_, support in self._supports]
        changed = holding != self._holding
        if changed:
            self._holding, self.held = holding, np.zeros(len(self._rest), dtype=bool)
            for mask, *_ in self._active():
                self.held |= mask
            self.pushes = any(not isinstance(o.motion, Still) for o in self._scene.obstacles)
            self.moves = self.pushes or any(not isinstance(support.motion, Still) for *_, support in self._active())
        return changed

    def end(self, time: float) -> float:
        """Ends the step at `time` [s]; the share of what was left of the motions that it carried out."""
        before = self.behind
        self.behind = time - self.clock if self.moves else 0.0
        return max(0.0, round(1.0 - self.behind / (self._scene.dt + before), 12))

    def _active(self):
        return [entry for entry, holds in zip(self._supports, self._holding, strict=True) if holds]

    def positions(self, time: float) -> np.ndarray:
        """(n_owned, d) [m]: where held vertices should be at `time` [s]; rest positions elsewhere."""
        target = self._rest.copy()
        for mask, mine, points, support in self._active():
            target[mask] = moved(support.motion, points, time, "a support")[mine]
        return target
