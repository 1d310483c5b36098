"""How scripted motions are cut into parts: a light stand-in for the motion, the potential and Newton says what is free,
and records what is queried.
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
END = 1.0  # s: shares of the step are seconds


@dataclass
class StandIn:
    """Supports hold all vertices, and go to the right by 1 m/s; contact allows each part `free` seconds of that, and
    after the first solve `opens`.
    """

    free: float = np.inf
    opens: float | None = None
    converges: bool = True
    detect: object = lambda self, length: min(1.0, self.free / length)
    clock: float = 0.0
    moves: bool = True
    moves_supports: bool = True
    end_of_span: float = END
    settings: Solver = Solver()
    asked: list = field(default_factory=list)
    places: list = field(default_factory=list)
    aims: list = field(default_factory=list)
    limits: list = field(default_factory=list)

    def positions(self, time):
        return REST + time * np.array([1.0, 0.0])

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
        return self.positions(until) - x.owned

    def max_step(self, x, path, until):
        self.asked.append(until - self.clock)
        return self.detect(self, self.asked[-1])

    def move_obstacles(self, time):
        self.places.append(time)

    def direction(self, x, along, path, until):
        self.aims.append(until)
        return path, np.ones(len(REST), dtype=bool), self.max_step(x, path, until), NewtonReport(iterations=1)

    def solve(self, x, max_iterations):
        self.limits.append(max_iterations)
        self.free = self.free if self.opens is None else self.opens
        return x, NewtonReport(converged=self.converges, iterations=max_iterations)


CREEPS = 1.1 * LEAST_GAIN / (1.0 - LEAST_LEFT)  # s: each part gains a little more than the least
STRICTER = lambda self, length: 1.0 if length <= 0.95 * self.free else min(0.95, self.free / length)


@pytest.mark.parametrize(
    ("world", "parts", "solves"),
    [
        (StandIn(), 1, 0),  # a free motion is one part
        (StandIn(free=0.1), 15, 0),
        (StandIn(free=CREEPS), 1.0 / LEAST_GAIN + 5, 0),  # in a bounded number of parts
        (StandIn(free=0.0, opens=np.inf), 10, 1),  # it goes on where a solve frees it
        (StandIn(free=0.4, detect=STRICTER), 10, 0),
        (StandIn(free=0.5 * LEAST_GAIN), None, 1),  # a part that gains too little is not taken
        (StandIn(free=0.5 * LEAST_GAIN, converges=False), None, 7),
        (StandIn(detect=lambda self, length: 0.999), None, 1),  # no path is free, and all are nearly so
    ],
)
def test_a_motion_is_followed_to_its_end_or_held_back(monkeypatch, world, parts, solves):
    """Each direction leads to the end of the span. Where that gains too little, directions for nearer places, and then
    longer and longer solves let the bodies give way. If that does not help, contact holds the motion back and nothing
    has moved.
    """
    monkeypatch.setattr(scripted_motion, "prescribed_direction", lambda newton, *where: newton.direction(*where))
    reports = []
    x = MotionParts(world, world, world, reports.append).follow(Positions(SPACE, REST))
    assert len(world.aims) == sum(report.remedies["substeps"] for report in reports)
    assert len(reports) == len(world.aims) + len(world.limits)
    assert world.limits == [FIRST_ITERATIONS * 2**k for k in range(solves)] and len(world.asked) < 200
    if parts is None:
        assert (world.clock, world.places) == (0.0, [])
        np.testing.assert_array_equal(x.owned, REST)
        if np.isfinite(world.free):
            np.testing.assert_allclose(world.aims[:2], [END, LEAST_LEFT * END])
        else:
            assert min(world.asked) > 0.8 * LEAST_GAIN, "paths shrink to the least gain, before and after a solve"
        assert solves == 1 or world.limits[-1] <= world.settings.max_iterations < 2 * world.limits[-1]
    else:
        assert world.clock == world.places[-1] == END and len(world.aims) <= parts
        assert solves or set(world.aims) == {END}
        np.testing.assert_allclose(x.owned, world.positions(END), atol=1e-12)
    if world.detect is STRICTER:  # the path that is tried next is shorter than the free one: two tries for a direction
        first, second = world.asked[:2]
        assert (first, second) == (END, (1.0 - LEAST_LEFT) * 0.4)
        assert world.places[0] == second and world.asked[2] == END - second
