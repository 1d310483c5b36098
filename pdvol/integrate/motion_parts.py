"""Scripted motions under contact: supports and obstacles are carried as far as nothing crosses, in parts of the step.

Each part ends at a time on the clock, with supports and obstacles exactly where their motions have them then; the
straight way there from the part before is what collision detection clears. So an obstacle that turns never stays on a
chord of its arc, and never is where it was not checked. Newton's direction lets bodies give way to supports and,
through the barrier, to obstacles. Where the bodies' own way to rest ends it early, what they give way by alone goes
further, and the rest is left to minimising between parts. Bodies' ways are straight, those of what turns are not: a
direction found for a place far ahead runs into it long before. So each is found for a place `AHEAD` times as far as the
last part came. A part never squeezes a cell below `CRUSHED` of its rest volume.
"""

from collections.abc import Callable

import numpy as np

from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.integrate.scripted_motion import Script
from pdvol.potentials.potential import KEPT_PRESSED, Positions
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.newton import Newton, NewtonReport

PARTS = 200  # of one step: more are not tried
TRIES = 6  # to find a free way for a part, each shorter
AHEAD = 2.0  # times the last part's length: where the next one's direction leads, unless the step ends before
NEAR = 0.005  # of the step: what a part that came less far counts as in that
KEEP = 0.9  # of the way found free is gone: detection asked again for all of it may say a little less
LITTLE = 2e-4  # of the step: a part that gains less is not gone at all, lest gaps shrink for nothing
# of the smallest gap before the first part: below it bodies get more iterations, lest part after part halves the gaps
PINCHED = 0.25
CRUSHED = 1e-3  # of its rest volume: no part squeezes a cell further
SHORTER = 0.5  # a part that would
RELAX = 2  # Newton iterations between parts
GIVE_WAY = 20  # where gaps are pinched


def follow(
    script: Script,
    potential: IncrementalPotential,
    newton: Newton,
    x: Positions,
    t1: float,
    count: Callable[[NewtonReport], None],
) -> Positions:
    """Carries everything scripted from `script.clock` towards its place at t1 [s]; bodies give way. Collective.

    The clock then tells how far that was possible. `count` is told of every solve. The state returned is admissible.
    """
    if script.clock == t1:
        return x
    least, near = LITTLE * (t1 - script.clock), NEAR * (t1 - script.clock)
    relaxed, gap, aim = False, potential.min_gap(x), t1
    for _ in range(PARTS):
        clock = script.clock
        further = _part(script, potential, newton, x, aim, least)
        aim = min(t1, script.clock + AHEAD * max(near, script.clock - clock))
        if further is not None:
            x = further
        elif relaxed:
            return x  # bodies have given way as far as they do: contact holds
        if script.clock == t1:
            return x
        relaxed, now = further is None, potential.min_gap(x)
        gap = now if gap == np.inf else gap  # the step began out of contact
        pinched = now < PINCHED * gap
        x, solved = newton.solve(x, most=None if relaxed else GIVE_WAY if pinched else RELAX, keep=KEPT_PRESSED)
        solved.rungs["substeps"] += 1
        count(solved)
    return x


def _part(
    script: Script, potential: IncrementalPotential, newton: Newton, x: Positions, t1: float, least: float
) -> Positions | None:
    """Goes the longest free part towards places at t1 [s]; None where that gains less than `least` [s]."""
    clock = script.clock
    push = potential.push(x, clock, t1) if script.pushes else 0.0
    furthest, there = clock, None
    for direction in newton.directions(x, script.positions(t1) - x.owned, push):
        until, end = _free_part(script, potential, x, t1, least, direction)
        if until > furthest:
            furthest, there = until, end
        if furthest == t1:
            break
    if there is not None:
        script.clock = furthest
        potential.place(furthest)
    return there


def _free_part(
    script: Script, potential: IncrementalPotential, x: Positions, t1: float, least: float, direction: np.ndarray
) -> tuple[float, Positions | None]:
    """Until when a part can go along a direction that leads to t1 [s], and where it ends; None where that gains less
    than `least` [s].
    """
    clock, held = script.clock, script.held[:, None]
    until, share = t1, 1.0
    for _ in range(TRIES):
        way = np.where(held, script.positions(until) - x.owned, share * direction)
        free = potential.max_step(x, way, until=until, keep=KEPT_PRESSED)
        end = x.moved(1.0, way) if free == 1.0 else None
        if end is not None and _smallest(end) >= min(CRUSHED, _smallest(x)):
            return until, end
        share *= KEEP * free if end is None else SHORTER
        until = clock + share * (t1 - clock)
        if until - clock < least:
            break
    return clock, None


def _smallest(x: Positions) -> float:
    """The smallest volume of a cell over that at rest. Collective where x is new."""
    mesh = x.space.mesh
    return float((simplex_volumes(x.whole, mesh.cells) / mesh.volumes).min())
