"""Scripted motions under contact, in parts of a span.

Supports and obstacles are moved as far as nothing crosses. Each part ends at a time on the clock, with supports and
obstacles exactly where their motions have them then. Collision detection clears the straight path there from the end of
the part before. So an obstacle that turns never stays on a chord of its arc.

Bodies that are free to go are carried along by the obstacles that they would hinder (`Carriers`), and all others stay.
That takes no solve, and where nothing is pressed it carries out the whole motion.

Where supports move, or bodies are pressed against something, bodies have to give way. Newton's direction lets them give
way to supports and, through the barrier, to obstacles; a few iterations between parts do the same. Bodies move on
straight lines, what turns does not: a direction found for a place far ahead is blocked early. So each direction is
found for a place `LOOK_AHEAD` times as far as the last part came.

Where a part gains too little and a whole solve does not help, contact holds. Each motion is then tried while all others
wait. Those that cannot go on alone wait up to the end of the span, and the clock goes on with the others.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pdvol.integrate.scripted_motion import ScriptedMotion
from pdvol.levels.obstacles import Obstacle
from pdvol.potentials.potential import SCRIPTED_GAP_SHARE, Positions
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.newton import Newton
from pdvol.solve.report import NewtonReport

MAX_PARTS = 200  # parts of one span: bounds the time that a blocked motion takes
MAX_TRIES = 6  # paths tried along one direction, each shorter than the last: bounds the search for a free one
# Fraction of the span: a part that gains less is not taken, since motions that press would close gaps to nothing. A
# ball that presses two cubes to a wall takes 196 iterations in seven steps, with a hundredth of this 1,841.
LEAST_GAIN = 0.02
# Times the last part's length: how far ahead, at most at the span's end, is the place that the next direction leads to.
# Above 1, so that parts can grow; not far above, since directions for places far ahead are blocked early.
LOOK_AHEAD = 2.0
PATH_SHARE = 0.9  # fraction of a free path that is tried next: detection for the shorter path may be stricter
RELAXING_ITERATIONS = 2  # Newton iterations between parts: enough for bodies to follow, and cheap

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
        relaxed, aim = False, t1
        for _ in range(MAX_PARTS):
            if motion.clock == t1 or not motion.moves:
                break
            clock = motion.clock
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
            relaxed = end is None
            limit = None if relaxed else RELAXING_ITERATIONS
            x, solved = self.newton.solve(x, max_iterations=limit, gap_share=SCRIPTED_GAP_SHARE)
            solved.remedies["substeps"] += 1
            self.count(solved)
        return x

    def _arrive(self, until: float, end: Positions) -> Positions:
        """Sets clock and obstacles to `until` [s], where a part ends."""
        self.motion.clock = until
        self.potential.move_obstacles(until)
        return end

    def _stop_slowest(self, x: Positions, least: float) -> bool:
        """Lets those motions wait that contact holds, and returns whether anything is left that goes on. Collective.

        Each is tried while all others wait. Those that gain less than `least` [s] wait. Where there are none, those
        that do not reach the span's end in one part do, if some others do. Motions that all reach it, but not together,
        are stopped one by one.
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
        enough = left if min(gains, default=0.0) > 0.0 else least
        slow = [mover for mover, gain in zip(going, gains, strict=False) if gain < enough] or going[:1]
        motion.stop(slow)
        return motion.moves and bool(slow)

    def _longest_part(self, x: Positions, t1: float, least: float, carried: Carried) -> tuple[float, Positions | None]:
        """The longest free part towards places at t1 [s], while bodies give way: when and where it ends; None where it
        gains less than `least` [s].
        """
        motion = self.motion
        push = self.potential.gradient_change(x, motion.clock, t1) if motion.moves_obstacles else 0.0
        direction = self.newton.direction(x, motion.positions(t1) - x.owned, push)
        return self._free_part(x, t1, least, direction, carried)

    def _free_part(
        self, x: Positions, t1: float, least: float, direction: np.ndarray, carried: Carried
    ) -> tuple[float, Positions | None]:
        """Until when a part can go along a direction that leads to t1 [s], and where it ends; None where that gains
        less than `least` [s].
        """
        clock, fraction, until = self.motion.clock, 1.0, t1
        for _ in range(MAX_TRIES):
            path = self.motion.path(x, until, fraction * direction, carried)
            free = self.potential.max_step(x, path, until=until, gap_share=SCRIPTED_GAP_SHARE)
            if free == 1.0:
                return until, x.moved(1.0, path)
            fraction *= PATH_SHARE * free
            until = clock + fraction * (t1 - clock)
            if until - clock <= least:
                break
        return clock, None
