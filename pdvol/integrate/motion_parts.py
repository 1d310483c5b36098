"""Scripted motions under contact, in parts of a span.

Supports and obstacles are moved as far as nothing crosses. Each part ends at a time on the clock, with supports and
obstacles exactly where their motions have them then. Collision detection clears the straight path there from the end of
the part before. So an obstacle that turns never stays on a chord of its arc.

Bodies that are free to go are carried along by the obstacles that they would hinder (`Carriers`), and all others
stay. That takes no solve, and where nothing is pressed it carries out the whole motion.

Where supports move, or bodies are pressed against something, bodies have to give way.
Newton's direction lets bodies give way to supports and, through the barrier, to obstacles. Where the bodies' own motion
towards equilibrium shortens the path, the part of the direction that is due to the scripted motion alone goes further,
and the remaining one is left to the minimisation between parts. Bodies move on straight lines, what turns does not: a
direction found for a place far ahead is blocked early. So each direction is found for a place `LOOK_AHEAD` times as far
as the last part came. A part never squeezes a cell below `MIN_CELL_VOLUME` of its volume at rest.

Where contact stops the clock, each motion is tried while all others wait. Those that cannot go on alone wait up to the
end of the span, and the clock goes on with the others. So do those, after half of the parts that a span may have, that
keep others waiting which could go to the end at once.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.integrate.scripted_motion import ScriptedMotion
from pdvol.levels.obstacles import Obstacle
from pdvol.potentials.potential import SCRIPTED_GAP_SHARE, Positions
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.newton import Newton
from pdvol.solve.report import NewtonReport

MAX_PARTS = 200  # parts of one span: bounds the time that a blocked motion takes
MAX_TRIES = 6  # paths tried along one direction, each shorter than the last: bounds the search for a free one
# Times the last part's length: how far ahead, at most at the span's end, is the place that the next direction leads to.
# Above 1, so that parts can grow; not far above, since directions for places far ahead are blocked early.
LOOK_AHEAD = 2.0
PATH_SHARE = 0.9  # fraction of a free path that is tried next: detection for the shorter path may be stricter
LEAST_GAIN = 2e-4  # fraction of the span: a part that gains less is not taken, since it closes gaps for nothing
PINCHED = 0.25  # fraction of the smallest gap before the first part: below it bodies get more iterations to open it
MIN_CELL_VOLUME = 1e-3  # fraction of a cell's volume at rest: Newton could not recover what is squeezed further
RELAXING_ITERATIONS = 2  # Newton iterations between parts: enough for bodies to follow, and cheap
OPENING_ITERATIONS = 20  # Newton iterations between parts where gaps are pinched: each opens one by a factor only

Carried = Mapping[int, Obstacle]
"""The obstacle that carries each body."""


@dataclass(frozen=True, eq=False)
class MotionParts:
    """Moves everything scripted towards its place at the span's end while bodies give way.

    Attributes
    ----------
    motion : ScriptedMotion
    potential : IncrementalPotential
    newton : Newton
    count : called after every solve
    """

    motion: ScriptedMotion
    potential: IncrementalPotential
    newton: Newton
    count: Callable[[NewtonReport], None]

    def follow(self, x: Positions) -> Positions:
        """The admissible state to which x gives way. Motions that contact stops are late afterwards. Collective."""
        motion, t1 = self.motion, self.motion.end_of_span
        least = LEAST_GAIN * (t1 - motion.clock)
        relaxed, gap, aim = False, self.potential.min_gap(x), t1
        for number in range(MAX_PARTS):
            if motion.clock == t1 or not motion.moves:
                break
            clock = motion.clock
            if number == MAX_PARTS // 2 and self._stop_slowest(x, least, for_the_free=True):
                relaxed, aim = False, t1
            carriers = motion.carriers(self.potential, x, t1)
            if not (carriers.blocked or motion.moves_supports):
                until, end = self._free_part(x, t1, 0.0, np.zeros_like(x.owned), carriers.of)
                if end is not None:
                    x, relaxed = self._arrive(until, end), False
                    continue
            until, end = self._longest_part(x, aim, least, carriers.of)
            aim = min(t1, until + LOOK_AHEAD * max(least, until - clock))
            if end is not None:
                x = self._arrive(until, end)
            elif relaxed:  # bodies have given way as far as they do: contact holds
                if not self._stop_slowest(x, least):
                    break
                relaxed, aim = False, t1
                continue
            if motion.clock == t1:
                break
            relaxed, now = end is None, self.potential.min_gap(x)
            gap = now if gap == np.inf else gap  # the span began out of contact
            limit = OPENING_ITERATIONS if now < PINCHED * gap else RELAXING_ITERATIONS
            x, solved = self.newton.solve(x, max_iterations=None if relaxed else limit, gap_share=SCRIPTED_GAP_SHARE)
            solved.remedies["substeps"] += 1
            self.count(solved)
        return x

    def _arrive(self, until: float, end: Positions) -> Positions:
        """Sets clock and obstacles to `until` [s], where a part ends."""
        self.motion.clock = until
        self.potential.move_obstacles(until)
        return end

    def _stop_slowest(self, x: Positions, least: float, for_the_free: bool = False) -> bool:
        """Lets those motions wait that contact holds, and returns whether anything is left that goes on. Collective.

        Each is tried while all others wait. Those that gain less than `least` [s] wait. Where there are none, those
        that do not reach the span's end in one part do, if some others do. Motions that all reach it, but not together,
        are stopped one by one.

        Parameters
        ----------
        for_the_free : stop all that do not reach the end in one part, if some do, and none otherwise
        """
        motion, going, left = self.motion, self.motion.going(), self.motion.end_of_span - self.motion.clock
        gains = []
        for mover in going if len(going) > 1 else ():
            others = [other for other in going if other is not mover]
            motion.stop(others)
            carriers = motion.carriers(self.potential, x, motion.end_of_span)
            until, end = self._longest_part(x, motion.end_of_span, least, carriers.of)
            motion.release(others)
            gains.append(0.0 if end is None else until - motion.clock)
        enough = left if for_the_free or min(gains, default=0.0) > 0.0 else least
        slow = [mover for mover, gain in zip(going, gains, strict=False) if gain < enough]
        if not (slow or for_the_free):
            slow = going[:1]
        if for_the_free and len(slow) in (0, len(going)):
            return False
        motion.stop(slow)
        return motion.moves and bool(slow)

    def _longest_part(self, x: Positions, t1: float, least: float, carried: Carried) -> tuple[float, Positions | None]:
        """The longest free part towards places at t1 [s]: when and where it ends; None where it gains less than `least`
        [s].
        """
        motion = self.motion
        push = self.potential.gradient_change(x, motion.clock, t1) if motion.moves_obstacles else 0.0
        furthest, there = motion.clock, None
        for direction in self.newton.directions(x, motion.positions(t1) - x.owned, push):
            until, end = self._free_part(x, t1, least, direction, carried)
            if until > furthest:
                furthest, there = until, end
            if furthest == t1:
                break
        return furthest, there

    def _free_part(
        self, x: Positions, t1: float, least: float, direction: np.ndarray, carried: Carried
    ) -> tuple[float, Positions | None]:
        """Until when a part can go along a direction that leads to t1 [s], and where it ends; None where that gains
        less than `least` [s].
        """
        clock = self.motion.clock
        until, fraction = t1, 1.0
        for _ in range(MAX_TRIES):
            path = self.motion.path(x, until, fraction * direction, carried)
            free = self.potential.max_step(x, path, until=until, gap_share=SCRIPTED_GAP_SHARE)
            if free == 1.0:
                end = x.moved(1.0, path)
                free = _unsqueezed(_smallest_volume(x), _smallest_volume(end))
                if free == 1.0:
                    return until, end
            fraction *= PATH_SHARE * free
            until = clock + fraction * (t1 - clock)
            if until - clock <= least:
                break
        return clock, None


def _unsqueezed(before: float, after: float) -> float:
    """The fraction of a path on which no cell is squeezed too far, if the smallest volume falls at a constant rate."""
    bound = min(MIN_CELL_VOLUME, before)
    return 1.0 if after >= bound else (before - bound) / (before - after)


def _smallest_volume(x: Positions) -> float:
    """The smallest volume of a cell over that at rest. Collective where x is new."""
    mesh = x.space.mesh
    return float((simplex_volumes(x.whole, mesh.cells) / mesh.volumes).min())
