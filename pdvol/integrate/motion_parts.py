"""Scripted motions under contact, in parts of a step.

Supports and obstacles are moved as far as nothing crosses. Each part ends at a time on the clock, with supports and
obstacles exactly where their motions have them then. Collision detection clears the straight path there from the end of
the part before. So an obstacle that turns never stays on a chord of its arc.

Bodies that are free to go are carried along by the obstacles that they would hinder (`carriers.py`), and all others
stay. That takes no solve, and where nothing is pressed it carries out the whole motion.

Where supports move, or bodies are pressed against something, bodies have to give way.
Newton's direction lets bodies give way to supports and, through the barrier, to obstacles. Where the bodies' own motion
towards equilibrium shortens the path, the part of the direction that is due to the scripted motion alone goes further,
and the rest is left to the minimisation between parts. Bodies move on straight lines, what turns does not: a direction
found for a place far ahead is blocked early. So each direction is found for a place `LOOK_AHEAD` times as far as the
last part came. A part never squeezes a cell below `MIN_CELL_VOLUME` of its rest volume.

Where contact stops the clock, each motion is tried with all others at rest. Those that cannot go on alone are stopped
for the rest of the step, and the clock goes on with the others. So are those, after half of the parts that a step may
have, that keep others waiting which could go to the end at once.
"""

from collections.abc import Callable, Mapping

import numpy as np

from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.integrate.scripted_motion import ScriptedMotion
from pdvol.levels.obstacles import Obstacle
from pdvol.potentials.potential import SCRIPTED_GAP_SHARE, Positions
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.newton import Newton
from pdvol.solve.report import NewtonReport

MAX_PARTS = 200  # parts of one step: bounds the time that a blocked motion takes
MAX_TRIES = 6  # paths tried along one direction, each shorter than the last: bounds the search for a free one
# Times the last part's length: how far ahead, at most at the step's end, is the place that the next direction leads to.
# Above 1, so that parts can grow; not far above, since directions for places far ahead are blocked early.
LOOK_AHEAD = 2.0
PATH_SHARE = 0.9  # share of a free path that is tried next: detection for the shorter path may be stricter
LEAST_GAIN = 2e-4  # share of the step: a part that gains less is not taken, since it closes gaps for nothing
PINCHED = 0.25  # share of the smallest gap before the first part: below it bodies get more iterations to open the gap
MIN_CELL_VOLUME = 1e-3  # share of a cell's rest volume: no part squeezes it further, or Newton could not recover it
RELAXING_ITERATIONS = 2  # Newton iterations between parts: enough for bodies to follow, and cheap
OPENING_ITERATIONS = 20  # Newton iterations between parts where gaps are pinched: each opens one by a factor only


def follow(
    motion: ScriptedMotion,
    potential: IncrementalPotential,
    newton: Newton,
    x: Positions,
    t1: float,
    count: Callable[[NewtonReport], None],
) -> Positions:
    """Moves everything scripted from `motion.clock` towards its place at t1 [s], while bodies give way. Collective.

    The clock then shows how far that was possible for what was not stopped. `count` is called after every solve. The
    state returned is admissible.
    """
    if motion.clock == t1:
        return x
    least = LEAST_GAIN * (t1 - motion.clock)
    relaxed, gap, aim = False, potential.min_gap(x), t1
    for number in range(MAX_PARTS):
        clock = motion.clock
        if number == MAX_PARTS // 2 and _stop_slowest(motion, potential, newton, x, t1, least, for_the_free=True):
            relaxed, aim = False, t1
        carriers = motion.carriers(potential, x, t1)
        if not (carriers.blocked or motion.moves_supports):
            still = np.zeros_like(x.owned)
            until, end = _free_part(motion, potential, x, t1, 0.0, still, carriers.of)
            if end is not None:
                x = _arrive(motion, potential, until, end)
                if until == t1:
                    return x
                relaxed = False
                continue
        further = _part(motion, potential, newton, x, aim, least, carriers.of)
        aim = min(t1, motion.clock + LOOK_AHEAD * max(least, motion.clock - clock))
        if further is not None:
            x = further
        elif relaxed:  # bodies have given way as far as they do: contact holds
            if not _stop_slowest(motion, potential, newton, x, t1, least):
                return x
            relaxed, aim = False, t1
            continue
        if motion.clock == t1:
            return x
        relaxed, now = further is None, potential.min_gap(x)
        gap = now if gap == np.inf else gap  # the step began out of contact
        limit = OPENING_ITERATIONS if now < PINCHED * gap else RELAXING_ITERATIONS
        x, solved = newton.solve(x, max_iterations=None if relaxed else limit, gap_share=SCRIPTED_GAP_SHARE)
        solved.remedies["substeps"] += 1
        count(solved)
    return x


def _arrive(motion: ScriptedMotion, potential: IncrementalPotential, until: float, end: Positions) -> Positions:
    """Sets clock and obstacles to `until` [s], where a part ends."""
    motion.clock = until
    potential.move_obstacles(until)
    return end


def _part(
    motion: ScriptedMotion,
    potential: IncrementalPotential,
    newton: Newton,
    x: Positions,
    t1: float,
    least: float,
    carriers: Mapping[int, Obstacle],
) -> Positions | None:
    """Takes the longest free part towards places at t1 [s]; None where that gains less than `least` [s]."""
    until, end = _longest_part(motion, potential, newton, x, t1, least, carriers)
    return None if end is None else _arrive(motion, potential, until, end)


def _stop_slowest(
    motion: ScriptedMotion,
    potential: IncrementalPotential,
    newton: Newton,
    x: Positions,
    t1: float,
    least: float,
    for_the_free: bool = False,
) -> bool:
    """Stops those motions that contact holds, and returns whether others are left that go on. Collective.

    Each is tried while all others rest. Those that gain less than `least` [s] are stopped. Where there are none, those
    that do not reach t1 [s] in one part are, if some do. Motions that all do, but not together, are stopped one by one.

    Parameters
    ----------
    for_the_free : stop all that do not reach t1 in one part, if some do, and none otherwise
    """
    going, clock = motion.going(), motion.clock
    if len(going) < 2:
        return False
    gains = []
    for mover in going:
        others = [other for other in going if other is not mover]
        motion.stop(others)
        carriers = motion.carriers(potential, x, t1)
        until, end = _longest_part(motion, potential, newton, x, t1, least, carriers.of)
        motion.release(others)
        gains.append(0.0 if end is None else until - clock)
    enough = t1 - clock if for_the_free or min(gains) > 0.0 else least
    slow = [mover for mover, gain in zip(going, gains, strict=True) if gain < enough]
    if not (slow or for_the_free):
        slow = going[:1]
    if len(slow) in (0, len(going)):
        return False
    motion.stop(slow)
    return True


def _longest_part(
    motion: ScriptedMotion,
    potential: IncrementalPotential,
    newton: Newton,
    x: Positions,
    t1: float,
    least: float,
    carriers: Mapping[int, Obstacle],
) -> tuple[float, Positions | None]:
    """The longest free part towards places at t1 [s]: when and where it ends; None where it gains less than `least`
    [s].
    """
    clock = motion.clock
    push = potential.gradient_change(x, clock, t1) if motion.moves_obstacles else 0.0
    furthest, there = clock, None
    for direction in newton.directions(x, motion.positions(t1) - x.owned, push):
        until, end = _free_part(motion, potential, x, t1, least, direction, carriers)
        if until > furthest:
            furthest, there = until, end
        if furthest == t1:
            break
    return furthest, there


def _free_part(
    motion: ScriptedMotion,
    potential: IncrementalPotential,
    x: Positions,
    t1: float,
    least: float,
    direction: np.ndarray,
    carriers: Mapping[int, Obstacle],
) -> tuple[float, Positions | None]:
    """Until when a part can go along a direction that leads to t1 [s], and where it ends; None where that gains less
    than `least` [s].
    """
    clock = motion.clock
    until, share = t1, 1.0
    for _ in range(MAX_TRIES):
        path = motion.path(x, until, share * direction, carriers)
        free = potential.max_step(x, path, until=until, gap_share=SCRIPTED_GAP_SHARE)
        if free == 1.0:
            end = x.moved(1.0, path)
            free = _unsqueezed(_smallest_volume(x), _smallest_volume(end))
            if free == 1.0:
                return until, end
        share *= PATH_SHARE * free
        until = clock + share * (t1 - clock)
        if until - clock <= least:
            break
    return clock, None


def _unsqueezed(before: float, after: float) -> float:
    """The share of a path on which no cell is squeezed too far, if the smallest volume falls at a constant rate."""
    bound = min(MIN_CELL_VOLUME, before)
    return 1.0 if after >= bound else (before - bound) / (before - after)


def _smallest_volume(x: Positions) -> float:
    """The smallest volume of a cell over that at rest. Collective where x is new."""
    mesh = x.space.mesh
    return float((simplex_volumes(x.whole, mesh.cells) / mesh.volumes).min())
