"""How scripted motions are cut into parts: light stand-ins for the potential and for Newton say what is free, and
record what is queried.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.integrate.scripted_motion import LEAST_GAIN, LOOK_AHEAD, Carriers, MotionParts
from pdvol.levels.space import LevelSpace
from pdvol.potentials.potential import LEAST_LEFT, PRESSED_GAP_SHARE, Positions
from pdvol.scene import Barrier, Plane, Support, Translation
from pdvol.solve.report import NewtonReport
from problems import block, make_scene, make_stepper, take_step

SPACE = LevelSpace(block((0.0, 0.0), (1.0, 1.0), 1), MPI.COMM_SELF)
REST = SPACE.from_input(SPACE.mesh.points)
RIGHT = REST[:, 0] > 0.5
EVERYWHERE = np.ones(len(REST), dtype=bool)
END = 1.0  # s: shares of the step are seconds


@dataclass
class Motion:
    """Held vertices go `way` (m/s, negative to the left) along x."""

    held: np.ndarray = field(default_factory=lambda: EVERYWHERE)
    way: float = 1.0
    clock: float = 0.0
    moves_obstacles: bool = False
    moves_supports: bool = True
    moves: bool = True
    end_of_span: float = END

    def positions(self, time):
        return REST + self.way * time * self.held[:, None] * [1.0, 0.0]

    def going(self):
        return ["the supports"] if self.moves else []

    def stop(self, movers):
        self.moves = not movers

    def carriers(self, potential, x, until):
        return Carriers(frozenset(), lambda of: ())

    def path(self, x, until, direction, of):
        return np.where(self.held[:, None], self.positions(until) - x.owned, direction)


@dataclass
class Potential:
    """Contact allows each part `free` seconds of the motion; the smallest gaps are `gaps`, then there is none."""

    motion: Motion
    free: float = np.inf
    gaps: Iterator = field(default_factory=lambda: iter(()))
    asked: list = field(default_factory=list)
    places: list = field(default_factory=list)
    shares: set = field(default_factory=set)
    solves: int = 0

    def min_gap(self, x):
        return next(self.gaps, np.inf)

    def max_step(self, x, path, until, gap_share):
        self.asked.append(until - self.motion.clock)
        self.shares.add(gap_share)
        return self.detect(self.asked[-1])

    def detect(self, length):
        return min(1.0, self.free / length)

    def move_obstacles(self, time):
        self.places.append(time)


@dataclass
class Newton:
    """Bodies go where supports go; after each solve contact allows the next number of seconds in `opens`."""

    potential: Potential
    aims: list = field(default_factory=list)
    limits: list = field(default_factory=list)
    opens: tuple = ()

    def direction(self, x, move, push):
        motion = self.potential.motion
        self.aims.append(motion.clock + move[RIGHT, 0].max() / motion.way)
        return move

    def solve(self, x, max_iterations, gap_share):
        self.limits.append(max_iterations)
        self.potential.shares.add(gap_share)
        self.potential.free = dict(enumerate(self.opens)).get(self.potential.solves, self.potential.free)
        self.potential.solves += 1
        return x, NewtonReport(converged=True)


def followed(potential, opens=()):
    """The state that `follow` ends with, Newton, and the reports that it counts."""
    newton, reports = Newton(potential, opens=opens), []
    x = MotionParts(potential.motion, potential, newton, reports.append).follow(Positions(SPACE, REST))
    assert len(reports) == len(newton.limits) == sum(report.remedies["substeps"] for report in reports)
    return x, newton


def test_a_free_motion_is_one_part():
    potential = Potential(Motion())
    x, newton = followed(potential)
    np.testing.assert_allclose(x.owned, potential.motion.positions(END), atol=1e-15)
    assert (potential.motion.clock, potential.asked, potential.places, newton.limits) == (END, [END], [END], [])


def test_directions_are_found_for_a_place_a_little_further_than_the_last_part_came():
    """`LOOK_AHEAD` times as far; the first one is found for the whole step, and none for a place beyond its end."""
    potential = Potential(Motion(), free=0.1)
    x, newton = followed(potential)
    ends = np.r_[0.0, potential.places]
    assert 1.0 < LOOK_AHEAD < 5.0 and newton.aims[0] == END == ends[-1]
    assert len(ends) >= END / 0.1
    lengths = np.diff(ends)
    np.testing.assert_allclose(newton.aims[1:], np.minimum(END, ends[1:-1] + LOOK_AHEAD * lengths[:-1]), rtol=1e-12)
    np.testing.assert_allclose(x.owned, potential.motion.positions(END), atol=1e-12)


def test_a_motion_that_creeps_is_followed_in_a_bounded_number_of_parts():
    """Each gains a little more than the least."""
    potential = Potential(Motion(), free=1.1 * LEAST_GAIN / (1.0 - LEAST_LEFT))
    x, newton = followed(potential)
    assert len(newton.limits) < 1.0 / LEAST_GAIN and potential.motion.clock == END
    np.testing.assert_allclose(x.owned, potential.motion.positions(END), atol=1e-12)


def test_a_part_that_gains_too_little_is_not_taken():
    """A whole solve then lets the bodies give way. If that does not help, contact holds the motion back and nothing has
    moved.
    """
    potential = Potential(Motion(), free=0.9 * LEAST_GAIN)
    x, newton = followed(potential)
    assert (potential.motion.clock, potential.places, newton.limits) == (0.0, [], [None])
    np.testing.assert_array_equal(x.owned, REST)


def test_a_motion_goes_on_where_a_whole_solve_frees_it():
    potential = Potential(Motion(), free=0.0)
    _, newton = followed(potential, opens=(np.inf,))
    assert potential.motion.clock == END
    assert newton.limits[0] is None and None not in newton.limits[1:]


class Stricter(Potential):
    """Collision detection that rejects a path of more than 0.95 of the free length."""

    def detect(self, length):
        return 1.0 if length <= 0.95 * self.free else min(0.95, self.free / length)


def test_the_path_that_is_tried_next_is_shorter_than_the_free_one():
    """So that the second path is free even where detection for it is stricter: two tries for each direction."""
    potential = Stricter(Motion(), free=0.4)
    followed(potential)
    first, second = potential.asked[:2]
    assert (first, second) == (END, (1.0 - LEAST_LEFT) * 0.4)
    assert potential.places[0] == second and potential.asked[2] == END - second


class Never(Potential):
    def detect(self, length):
        return 0.999


def test_the_search_for_a_free_path_ends():
    """Where none is free and all are nearly so: paths shrink to the least gain, before and after a whole solve."""
    potential = Never(Motion())
    _, newton = followed(potential)
    most = np.log(LEAST_GAIN) / np.log(1.0 - LEAST_LEFT)
    assert 2 <= len(potential.asked) < 2 * (most + 1) and newton.limits == [None]
    assert min(potential.asked) > LEAST_GAIN


def test_scripted_motions_leave_more_of_a_gap():
    """In paths and in solves between parts."""
    potential = Potential(Motion(), free=0.3)
    followed(potential)
    assert potential.shares == {PRESSED_GAP_SHARE}


@pytest.mark.parametrize("moves, share", [(True, PRESSED_GAP_SHARE), (False, LEAST_LEFT)])
def test_solves_of_a_step_leave_that_share_of_a_gap(monkeypatch, moves, share):
    """The larger one where a support presses a block to a wall, the smaller one where the block flies against it."""
    supports = (Support(lambda X: X[:, 0] < 1e-9, motion=Translation((15.0, 0.0))),) if moves else ()
    wall = Plane((0.35, 0.0), (-1.0, 0.0))
    scene = make_scene(dt=0.02, obstacles=(wall,), supports=supports, contact=(Barrier(dhat=5e-3),))
    mesh, shares = block((0.0, 0.0), (0.3, 0.2), 1), []
    problem = make_stepper(scene, mesh)
    solve = problem.newton.solve

    def recorded(*arguments, gap_share, **more):
        shares.append(gap_share)
        return solve(*arguments, gap_share=gap_share, **more)

    monkeypatch.setattr(problem.newton, "solve", recorded)
    report = take_step(problem, 1, mesh.points, np.tile((0.0 if moves else 10.0, 0.0), (len(mesh.points), 1)))
    assert (report.remedies["substeps"] > 0) == moves and (moves or report.contacts > 0)
    assert set(shares) == {share} and 0.0 < LEAST_LEFT < PRESSED_GAP_SHARE < 1.0
