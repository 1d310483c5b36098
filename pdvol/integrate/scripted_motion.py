"""What supports and obstacles prescribe on one level, how far their motions were carried out, and what goes along with
moving obstacles.

A step begins with `begin`, each part of it that is solved at once with `begin_span`, and it ends with `end`: each
motion is then at the step's end or behind it (`levels/script.py`).

Motions under contact are carried out in parts of a span (`MotionParts`), as far as nothing crosses. Each part ends at a
time on the clock, with supports and obstacles exactly where their motions have them then: an obstacle that turns never
stays on a chord of its arc. Collision detection clears the straight path there from the end of the part before.

Bodies that are free to go are carried along by the obstacles that they would hinder (`carriers`), and all others stay.
That takes no solve, and where nothing is pressed it carries out the whole motion.

Where supports move, or bodies are pressed against something, bodies have to give way. A part is then one of Newton's
directions for the place at the span's end. What touches a moving obstacle goes along with it: by its rigid motion and,
where it deforms, by what its nearest point does besides. Bodies stick to each other where they touch. Pairs that would
meet otherwise are predicted to (`potentials/contact/barrier.py`). The step's own solve lets what was carried slide.

Where a part gains too little, Newton iterations with all motions at rest let bodies give way, twice as many each time.
Where they converge, contact holds. Each motion is then tried while all others wait. Those that cannot go on alone wait
up to the end of the span, and the clock goes on with the others.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pdvol.geometry.rigid_motions import Pose
from pdvol.levels.script import ON_TIME, HeldPoints, Mover, Obstacle, Script
from pdvol.levels.space import LevelSpace
from pdvol.potentials.potential import LEAST_LEFT, Positions
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.newton import Newton
from pdvol.solve.prescribed import prescribed_direction
from pdvol.solve.report import NewtonReport

# Fraction of the span: a part that gains less is not taken, since motions that press would close gaps to nothing. A
# ball that presses two cubes to a wall takes 196 iterations in seven steps, with a hundredth of this 1,841.
LEAST_GAIN = 0.02
FIRST_ITERATIONS = 4  # Newton iterations, without a unit, after a part that gained too little: few serve most

Object = int | Obstacle
"""A body by its number, or an obstacle."""
Carried = Mapping[int, Obstacle]
"""The obstacle that carries each body."""
Along = Mapping[Obstacle, np.ndarray]
"""The rows of this rank that go along with each obstacle."""


class ScriptedMotion:
    """The supports of a level, and the times of all motions.

    Parameters
    ----------
    script : that of the terms
    start : (n, d) [m]
        Where vertices are that nothing holds: `positions` has them there.
    dt : the length of a step [s]

    Attributes
    ----------
    held : (n_owned,) bool
        Vertices that supports hold in the present step.
    clock : time [s] up to which motions have been carried out that were not stopped
    """

    def __init__(self, space: LevelSpace, script: Script, start: np.ndarray, dt: float):
        self._dt, self._start, self._script = dt, space.from_input(start), script
        self._bodies, self._point_bodies = space.mesh.point_bodies[space.owned_points], space.mesh.point_bodies
        # Every rank moves all points of a support, so that a motion that fails does so on all ranks.
        self._supports = [_Owned(support, space) for support in script.supports]
        self._lags: dict[Mover, float] = {}
        self._holding: list[bool] | None = None
        self._moving: dict[str, Mover] = {}  # in the present step and with respect to the ground, by name
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
        active, until = {support.points for support in self._active()}, time + self._dt
        self._moving = {
            name: mover
            for name, mover in self._script.movers.items()
            if (isinstance(mover, Obstacle) or mover in active)
            and self._script.moves(mover, time - self._lags.get(mover, 0.0), until)
        }
        self._ground_moves = self._script.ground_moves(time, until)
        self._lags = {mover: self._lags.get(mover, 0.0) for mover in self._moving.values()}
        self.begin_span(time, until, self._lags)
        return changed

    def begin_span(self, t0: float, t1: float, lags: Mapping[Mover, float]) -> None:
        """Starts a part of the step that is solved at once, from t0 to t1 [s]."""
        self.clock, self.end_of_span = t0, t1
        self._script.begin(t0, t1, lags)

    @property
    def lags(self) -> dict[Mover, float]:
        """How late motions are at the clock's time [s]."""
        return {mover: self._script.lag(mover, self.clock) for mover in self._moving.values()}

    @property
    def moves(self) -> bool:
        """Whether supports or obstacles are elsewhere at the end of the span."""
        return self._ground_moves or bool(self.going())

    @property
    def moves_supports(self) -> bool:
        """Whether supports are; moving ground takes all of them along."""
        going = any(not isinstance(mover, Obstacle) for mover in self.going())
        return going or (self._ground_moves and bool(self._active()))

    def end(self) -> tuple[float, float, dict[str, float]]:
        """Ends the step.

        Returns
        -------
        reached : the smallest fraction of its remaining motion that a support or obstacle has carried out
        behind : [s] how far it is behind the time, at most
        late : [s] the same of each that is, by its name; empty where all others could be as far behind
        """
        before, self._lags = self._lags, self.lags
        left = (round(1.0 - lag / (self._dt + before[mover]), 12) for mover, lag in self._lags.items())
        lags = {name: self._lags[mover] for name, mover in self._moving.items()}
        most, end = max(lags.values(), default=0.0), self.end_of_span
        rest = [mover for name, mover in self._script.movers.items() if name not in lags and most > 0.0]
        apart = len(set(lags.values())) > 1 or any(self._script.moves(mover, end - most, end) for mover in rest)
        late = {name: lag for name, lag in lags.items() if lag > 0.0} if apart else {}
        return max(0.0, min(left, default=1.0)), most, late

    def go_on_from(self, behind: float, late: Mapping[str, float]) -> None:
        """Sets what `end` gave."""
        self._lags = self._script.recorded_lags(behind, late)

    def going(self) -> list[Mover]:
        """What moves with respect to the ground and has not been stopped in the present span."""
        return [mover for mover in self._moving.values() if not self._script.is_stopped(mover)]

    def stop(self, movers: Sequence[Mover]) -> None:
        """Lets some motions wait where they are, up to the end of the span."""
        self._script.stop(movers, self.clock)

    def release(self, movers: Sequence[Mover]) -> None:
        """Lets some motions go on that were stopped at the clock's present time."""
        self._script.release(movers)

    def _active(self) -> "list[_Owned]":
        return [support for support, holds in zip(self._supports, self._holding or [], strict=True) if holds]

    def positions(self, time: float) -> np.ndarray:
        """(n_owned, d) [m]: where held vertices should be when the clock shows `time` [s]; those at t = 0 elsewhere."""
        target = self._start.copy()
        for support in self._active():
            target[support.mask] = self._script.place(support.points, time)[support.rows]
        return target

    def carriers(self, potential: IncrementalPotential, x: Positions, until: float) -> tuple[Carried, bool]:
        """Who carries which body from x (at `clock`) while motions go on to `until` [s], and whether something would
        meet even so. Collective.
        """
        nothing = np.zeros_like(x.owned)
        meet = lambda of: potential.closing(x, self.path(x, until, nothing, self.rows_of(of)), until)
        return carriers(self._held_bodies, meet)

    def rows_of(self, carried: Carried) -> Along:
        """The rows of carried bodies."""
        return {
            carrier: np.flatnonzero(np.isin(self._bodies, [body for body, by in carried.items() if by is carrier]))
            for carrier in set(carried.values())
        }

    def touched(self, potential: IncrementalPotential, x: Positions, carried: Carried) -> Along:
        """The rows that go along with obstacles where bodies give way: those of carried bodies, and what else touches
        an obstacle that goes on, or waits on ground that does. Collective.
        """
        along, free = dict(self.rows_of(carried)), ~self.held & ~np.isin(self._bodies, list(carried))
        going = self.going()
        moving = [o for o in self._script.obstacles if o.moves and (self._ground_moves or o in going)]
        for obstacle, rows in potential.touched(x, moving).items():
            along[obstacle] = np.concatenate([along.get(obstacle, np.zeros(0, int)), rows[free[rows]]])
        return along

    def path(self, x: Positions, until: float, direction: np.ndarray, along: Along) -> np.ndarray:
        """(n_owned, d) [m]: the way from x (at `clock`) to where supports hold vertices at `until` [s], for what goes
        along with obstacles with these, for all others along direction (n_owned, d).
        """
        path = np.where(self.held[:, None], self.positions(until) - x.owned, direction)
        for obstacle, rows in along.items():
            if obstacle.kind == "plane":
                moved = self._script.pose(obstacle, until) @ self._script.pose(obstacle, self.clock).inverse
            else:
                start, end = (self._script.place(obstacle, time) for time in (self.clock, until))
                moved = Pose.fitted(start, end)
            path[rows] = moved(x.owned[rows]) - x.owned[rows]
            if len(rows) and not (obstacle.kind == "plane" or obstacle.rigid):
                from pdvol.levels.animated import nearest_on  # loads libigl, which few scenes need

                facets = obstacle.faces if obstacle.kind == "mesh" else obstacle.edges
                path[rows] += nearest_on(start, facets, x.owned[rows]).on(end - moved(start))
        return path


class _Owned:
    """A support with the part of it on this rank: mask (n_owned,) of owned vertices, and their rows in its points."""

    def __init__(self, points: HeldPoints, space: LevelSpace):
        self.points, self.mask = points, points.mask[space.owned_points]
        self.rows = np.cumsum(points.mask)[space.owned_points][self.mask] - 1


def carriers(held: frozenset[int], meet: Callable[[Carried], Iterable[tuple[Object, Object]]]) -> tuple[Carried, bool]:
    """The bodies that moving obstacles carry towards their places at a time: free bodies that they would meet go along
    rigidly, and so do those that these meet.

    Seen from an obstacle, a body that goes along with it stays where it is. A step against an obstacle that moves is
    then as hard as one against an obstacle that stands still. What bodies do meanwhile is left to the minimisation.

    On straight ways all points that follow one rigid motion undergo one affine map (1 - s) I + s R at each fraction s
    of the way. Below half a turn it is regular, so nothing that goes along can cross the obstacle or invert.

    Parameters
    ----------
    held : numbers of the bodies that supports hold: nothing carries them
    meet : the obstacle that carries each body -> pairs of objects that would meet if it did

    Returns
    -------
    of : the obstacle that carries each body
    blocked : whether something would meet even so: bodies must give way by themselves
    """
    of: dict[int, Obstacle] = {}
    tried, stuck = set[tuple[int, Obstacle]](), set(held)

    def joining(one: Object, other: Object) -> Iterator[tuple[int, Obstacle]]:
        """Who could carry either of two objects that would meet: the other one's carrier, unless that was tried."""
        for body, by in ((one, other), (other, one)):
            carrier = by if isinstance(by, Obstacle) else of.get(by)
            if carrier is None or not carrier.moves or isinstance(body, Obstacle):
                continue
            if body not in stuck and (body, carrier) not in tried:
                yield body, carrier

    while True:
        pairs = list(meet(of))
        joined = {body: carrier for pair in pairs for body, carrier in joining(*pair)}
        pressed = {body for pair in pairs for body in pair if body in of}
        if joined:
            of |= joined
            tried |= set(joined.items())
        elif pressed:  # against something that does not go along
            stuck |= pressed
            of = {body: carrier for body, carrier in of.items() if body not in pressed}
        else:
            return of, bool(pairs)


@dataclass(frozen=True, eq=False)
class MotionParts:
    """Moves everything scripted towards its place at the span's end while bodies give way.

    Attributes
    ----------
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
        allowed, settled, brief = FIRST_ITERATIONS, False, False
        # Each pass gains enough, or makes the next solve twice as long, or stops motions: the loop ends.
        while motion.clock < t1 and motion.moves:
            clock = motion.clock
            until, end = self.longest_part(x, least, 0.0 if not brief else least)
            if end is not None:
                x, brief = self._arrive(until, end), until - clock < least
                allowed, settled = FIRST_ITERATIONS, False
            elif not settled:
                x, solved = self.newton.solve(x, max_iterations=allowed)
                settled, allowed = solved.converged or solved.iterations < allowed, 2 * allowed
                settled |= allowed > self.newton.settings.max_iterations
                self.count(solved)
            elif self._stop_slowest(x, least):  # bodies have given way as far as they do: contact holds
                settled = False
            else:
                break
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
            until, end = self.longest_part(x, least, least)
            motion.release(others)
            gains.append(0.0 if end is None else until - motion.clock)
        enough = left if min(gains, default=0.0) > 0.0 else least
        slow = [mover for mover, gain in zip(going, gains, strict=False) if gain < enough] or going[:1]
        motion.stop(slow)
        return motion.moves and bool(slow)

    def longest_part(self, x: Positions, least: float, brief: float) -> tuple[float, Positions | None]:
        """The longest free part: when and where it ends; None where it gains less than `least` [s], and less than half
        of what is left. One that takes no solve gains `brief` [s] at least: it brings obstacles to what they carry.
        """
        motion, clock, t1 = self.motion, self.motion.clock, self.motion.end_of_span
        least, brief = (max(min(gain, 0.5 * (t1 - clock)), ON_TIME * (t1 - clock)) for gain in (least, brief))
        carried, blocked = motion.carriers(self.potential, x, t1)
        if not (blocked or motion.moves_supports):
            nothing, along, until = np.zeros_like(x.owned), motion.rows_of(carried), t1
            while until - clock > brief:  # each path is a tenth shorter or more
                free, end = self._free_part(x, t1, until, nothing, along)
                if end is not None:
                    return until, end
                until = clock + free * (until - clock)
        touched, aim = motion.touched(self.potential, x, carried), t1
        while aim - clock > least:
            path = motion.path(x, aim, np.zeros_like(x.owned), touched)
            direction, fixed, free, solved = prescribed_direction(self.newton, x, touched, path, aim)
            solved.remedies["substeps"] += 1
            self.count(solved)
            along = {obstacle: rows[fixed[rows]] for obstacle, rows in touched.items()}
            until = aim if free == 1.0 else clock + (1.0 - LEAST_LEFT) * free * (aim - clock)
            end = self._free_part(x, aim, until, direction, along)[1] if until - clock > least else None
            if end is not None:
                return until, end
            # What turns goes on arcs, bodies on straight lines: directions for nearer places are better ones.
            aim = clock + max(LEAST_LEFT, (1.0 - LEAST_LEFT) * free) * (aim - clock)
        return clock, None

    def _free_part(
        self, x: Positions, aim: float, until: float, direction: np.ndarray, along: Along
    ) -> tuple[float, Positions | None]:
        """Where a part ends `until` [s] that goes along a direction, which leads to `aim` [s]; or the share of it that
        may be free, and None.
        """
        path = self.motion.path(x, until, (until - self.motion.clock) / (aim - self.motion.clock) * direction, along)
        free = self.potential.max_step(x, path, until=until)
        if free == 1.0:
            return free, x.moved(1.0, path)
        return (1.0 - LEAST_LEFT) * free, None  # detection for the shorter path may be stricter
