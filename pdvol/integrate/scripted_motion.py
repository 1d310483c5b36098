"""What supports and obstacles prescribe on one level, and how far their motions were carried out.

All motions of a scene share one clock: supports and obstacles that contact stops stay on their paths, and go on from
there as soon as they can. A step ends with the clock at its own time, or `behind` it.

Under contact, supports and obstacles are moved as far as nothing crosses, in parts of the step. Each part ends at a
time on the clock, with supports and obstacles exactly where their motions have them then. Collision detection clears
the straight path there from the end of the part before. So an obstacle that turns never stays on a chord of its arc.

Bodies that are free to go are carried along by the obstacles that they would hinder (`carriers.py`), and all others
stay. That takes no solve, and where nothing is pressed it carries out the whole motion.

Where supports move, or bodies are pressed against something, bodies have to give way.
Newton's direction lets bodies give way to supports and, through the barrier, to obstacles. Where the bodies' own motion
towards equilibrium shortens the path, the part of the direction that is due to the scripted motion alone goes further,
and the rest is left to the minimisation between parts. Bodies move on straight lines, what turns does not: a direction
found for a place far ahead is blocked early. So each direction is found for a place `LOOK_AHEAD` times as far as the
last part came. A part never squeezes a cell below `MIN_CELL_VOLUME` of its rest volume.
"""

from collections.abc import Callable, Mapping

import numpy as np

from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.integrate.carriers import Carriers, rigid_motion
from pdvol.levels.model import HeldPoints, LevelModel
from pdvol.levels.obstacles import Obstacle
from pdvol.levels.space import LevelSpace
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


class ScriptedMotion:
    """The supports of a level, and the clock of all motions.

    Attributes
    ----------
    held : (n_owned,) bool
        Vertices that supports hold in the present step.
    moves : bool
        Whether supports or obstacles move in the present step.
    moves_supports : bool
        Whether supports move in the present step.
    moves_obstacles : bool
        Whether an obstacle moves.
    clock : time [s] up to which motions have been carried out
    behind : [s] how far that is behind the end of the last step
    """

    def __init__(self, model: LevelModel, space: LevelSpace):
        self._dt, self._rest = model.dt, space.from_input(space.mesh.points)
        self._bodies, self._point_bodies = space.mesh.point_bodies[space.owned_points], space.mesh.point_bodies
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
            self.moves_supports = any(support.points.moves for support in self._active())
            self.moves = self.moves_obstacles or self.moves_supports
            held = [self._point_bodies[support.points.mask] for support in self._active()]
            self._held_bodies = frozenset(np.concatenate([*held, np.zeros(0, int)]).tolist())
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
            moved = rigid_motion(carrier.at(self.clock), carrier.at(until))
            rows = np.isin(self._bodies, [body for body, by in of.items() if by is carrier])
            path[rows] = moved(x.owned[rows]) - x.owned[rows]
        return path


class _Owned:
    """A support with the part of it on this rank: mask (n_owned,) of owned vertices, and their rows in its points."""

    def __init__(self, points: HeldPoints, space: LevelSpace):
        self.points, self.mask = points, points.mask[space.owned_points]
        self.rows = np.cumsum(points.mask)[space.owned_points][self.mask] - 1


def follow(
    motion: ScriptedMotion,
    potential: IncrementalPotential,
    newton: Newton,
    x: Positions,
    t1: float,
    count: Callable[[NewtonReport], None],
) -> Positions:
    """Moves everything scripted from `motion.clock` towards its place at t1 [s], while bodies give way. Collective.

    The clock then shows how far that was possible. `count` is called after every solve. The state returned is
    admissible.
    """
    if motion.clock == t1:
        return x
    least = LEAST_GAIN * (t1 - motion.clock)
    relaxed, gap, aim = False, potential.min_gap(x), t1
    for _ in range(MAX_PARTS):
        clock = motion.clock
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
        elif relaxed:
            return x  # bodies have given way as far as they do: contact holds
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
    clock = motion.clock
    push = potential.gradient_change(x, clock, t1) if motion.moves_obstacles else 0.0
    furthest, there = clock, None
    for direction in newton.directions(x, motion.positions(t1) - x.owned, push):
        until, end = _free_part(motion, potential, x, t1, least, direction, carriers)
        if until > furthest:
            furthest, there = until, end
        if furthest == t1:
            break
    return None if there is None else _arrive(motion, potential, furthest, there)


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
