"""How scripted motions are cut into parts: light stand-ins for the potential and for Newton say what is free, and
record what is queried.
"""

from dataclasses import dataclass, field

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.integrate import scripted_motion
from pdvol.integrate.scripted_motion import FIRST_ITERATIONS, LEAST_GAIN, MotionParts
from pdvol.levels.space import LevelSpace
from pdvol.potentials.potential import LEAST_LEFT, Positions
from pdvol.scene import Solver
from pdvol.solve.report import NewtonReport
from problems import block

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
        return {}, False

    def touched(self, potential, x, carried):
        return {}

    def rows_of(self, carried):
        return {}

    def path(self, x, until, direction, along):
        return np.where(self.held[:, None], self.positions(until) - x.owned, direction)


@dataclass
class Potential:
    """Contact allows each part `free` seconds of the motion."""

    motion: Motion
    free: float = np.inf
    asked: list = field(default_factory=list)
    places: list = field(default_factory=list)
    solves: int = 0

    def max_step(self, x, path, until):
        self.asked.append(until - self.motion.clock)
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
    converges: bool = True
    settings: Solver = Solver()

    def direction(self, x, along, path, until):
        self.aims.append(until)
        free = self.potential.max_step(x, path, until)
        return path, self.potential.motion.held, free, NewtonReport(iterations=1)

    def solve(self, x, max_iterations):
        self.limits.append(max_iterations)
        self.potential.free = dict(enumerate(self.opens)).get(self.potential.solves, self.potential.free)
        self.potential.solves += 1
        return x, NewtonReport(converged=self.converges, iterations=max_iterations)


@pytest.fixture(autouse=True)
def stand_in(monkeypatch):
    monkeypatch.setattr(scripted_motion, "prescribed_direction", lambda newton, *where: newton.direction(*where))


def followed(potential, opens=(), **more):
    """The state that `follow` ends with, Newton, and the reports that it counts."""
    newton, reports = Newton(potential, opens=opens, **more), []
    x = MotionParts(potential.motion, potential, newton, reports.append).follow(Positions(SPACE, REST))
    assert len(newton.aims) == sum(report.remedies["substeps"] for report in reports)
    assert len(reports) == len(newton.aims) + len(newton.limits)
    return x, newton


def test_a_free_motion_is_one_part():
    potential = Potential(Motion())
    x, newton = followed(potential)
    np.testing.assert_allclose(x.owned, potential.motion.positions(END), atol=1e-15)
    assert (potential.motion.clock, potential.places, newton.aims, newton.limits) == (END, [END], [END], [])


def test_each_direction_leads_to_the_end_of_the_span():
    potential = Potential(Motion(), free=0.1)
    x, newton = followed(potential)
    assert set(newton.aims) == {END} == {potential.places[-1]} and not newton.limits
    np.testing.assert_allclose(x.owned, potential.motion.positions(END), atol=1e-12)


def test_a_motion_that_creeps_is_followed_in_a_bounded_number_of_parts():
    """Each gains a little more than the least."""
    potential = Potential(Motion(), free=1.1 * LEAST_GAIN / (1.0 - LEAST_LEFT))
    x, newton = followed(potential)
    assert len(newton.aims) < 1.0 / LEAST_GAIN + 5 and potential.motion.clock == END
    np.testing.assert_allclose(x.owned, potential.motion.positions(END), atol=1e-12)


@pytest.mark.parametrize("converges, solves", [(True, 1), (False, 7)])
def test_a_part_that_gains_too_little_is_not_taken(converges, solves):
    """Directions for nearer places, and then longer and longer solves let the bodies give way. If that does not help,
    contact holds the motion back and nothing has moved.
    """
    potential = Potential(Motion(), free=0.5 * LEAST_GAIN)
    x, newton = followed(potential, converges=converges)
    assert (potential.motion.clock, potential.places) == (0.0, [])
    assert newton.limits == [FIRST_ITERATIONS * 2**k for k in range(solves)]
    assert newton.limits[-1] <= newton.settings.max_iterations < 2 * FIRST_ITERATIONS * 2**6
    np.testing.assert_allclose(newton.aims[:2], [END, LEAST_LEFT * END])
    np.testing.assert_array_equal(x.owned, REST)


def test_a_motion_goes_on_where_a_solve_frees_it():
    potential = Potential(Motion(), free=0.0)
    _, newton = followed(potential, opens=(np.inf,))
    assert potential.motion.clock == END and newton.limits == [FIRST_ITERATIONS]


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
    """Where none is free and all are nearly so: paths shrink to the least gain, before and after a solve."""
    potential = Never(Motion())
    _, newton = followed(potential)
    assert newton.limits == [FIRST_ITERATIONS] and len(potential.asked) < 200
    assert min(potential.asked) > 0.8 * LEAST_GAIN
