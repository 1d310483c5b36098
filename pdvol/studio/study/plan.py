"""Which run of a study comes next: the scene as it is, jittered starts, reference, single changes, combinations."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.runs.preflight import COST_EXPONENT, COST_OFFSET
from pdvol.scene import Scene
from pdvol.studio.study.axes import Axis, cost_factor
from pdvol.studio.study.front import candidates
from pdvol.studio.wedge.variation import Variation, times

JITTERS = 3  # repeated starts
REFERENCE_SHARE = 0.35  # of the budget: what the reference may take, one run that nothing can shorten
FINER_STEPS = (2, 4, 8)  # the scene's time step in references' ones; powers of two, so that runs share times
STRICTER = 0.1  # the reference's tolerance, in the scene's
BETTER = {"integrator": "bdf2", "elements": "smoothed"}  # the reference's methods, where they are varied
LEVEL_SHARE = 0.08  # of the budget: what the scene's own settings may take on all levels of a study
MOST_COMBINATIONS = 24
REFERENCE = "a reference"  # what its run is wanted for
START_UP = 3.5  # CPU seconds of a process before its first step
CROWDED = 1.2  # a job's seconds beside others, in CPU seconds of its steps: at least, until more is seen

UNKNOWN_GROWTH = 3.0  # vertices of a level in those of the one below, where the scene gives no counts


def finest_level(scene: Scene, mesh: LevelMesh, seconds: float, allowed: float) -> int:
    """The finest level that takes `allowed` seconds at most with all coarser ones, by those of level 0."""
    offset = COST_OFFSET[mesh.dim]
    targets = [body.vertices for body in scene.bodies if len(body.vertices)]
    total, count, finest = 0.0, float(len(mesh.points)), 0
    for level in range(scene.levels):
        if level:
            below = sum(t[level - 1] for t in targets)
            count *= sum(t[level] for t in targets) / below if targets else UNKNOWN_GROWTH
        total += seconds * ((count + offset) / (len(mesh.points) + offset)) ** COST_EXPONENT
        if total <= allowed:
            finest = level
    return finest


@dataclass(frozen=True)
class Wanted:
    """A run that is wanted: a variation on levels 0 to `last`, and what for."""

    variation: Variation
    last: int
    purpose: str


@dataclass
class Plan:
    """The order of runs, from what is known so far. It starts nothing itself.

    Attributes
    ----------
    axes : what is varied, one at a time first
    alone : whether levels simulated alone are compared
    method : of the scene's own settings
    values : the scene's own values, of dt, tolerance and all axes
    seconds : the budget [s]
    speed : [m/s] of jitter
    reference : the user's choice; None where the plan chooses
    last : the finest level; None until it is known
    done : runs with a result
    closed : runs that failed or were left out
    costs : CPU seconds of each level, by run
    taken : seconds and CPU seconds of all runs so far
    """

    axes: Sequence[Axis]
    alone: bool
    method: str
    values: Mapping[str, Any]
    seconds: float
    speed: float
    reference: Variation | None = None
    last: int | None = None
    done: dict[Variation, int] = field(default_factory=dict)
    closed: dict[Variation, str] = field(default_factory=dict)
    costs: dict[Variation, list[float]] = field(default_factory=dict)
    taken: tuple[float, float] = (0.0, 0.0)
    _combined: list[Variation] = field(default_factory=list)
    _ladder: list[Variation] = field(default_factory=list)

    @property
    def base(self) -> Variation:
        """The scene as it is."""
        return Variation(method=self.method)

    @property
    def jitters(self) -> list[Variation]:
        """Repeated starts of level 0."""
        return [Variation.of({"jitter": (self.speed, seed)}, self.method) for seed in range(1, JITTERS + 1)]

    @property
    def singles(self) -> list[Variation]:
        """One change each, the most telling values of all axes first; levels alone after the first two."""
        each = [axis.variations(self.method) for axis in self.axes]
        ordered = [v for row in itertools.zip_longest(*each) for v in row if v is not None]
        if self.alone and self.method != "direct" and self.last:
            ordered.insert(2, Variation(method="direct"))
        return ordered

    def ladder(self) -> list[Variation]:
        """What may serve as the reference, the cheapest first: each has half the time step of the one before. Empty
        before the scene's own settings ran on all levels. It stays the same when costs become better known.
        """
        if not self._ladder and self.last is not None and self.done.get(self.base, -1) >= self.last:
            if self.reference is not None:
                changes = dict(self.reference.changes)
                twice = times(changes.get("dt", self.values["dt"]), 2.0)
                self._ladder = [Variation.of({**changes, "dt": twice}, self.reference.method), self.reference]
                return self._ladder
            strict: dict[str, Any] = {"tolerance": times(self.values["tolerance"], STRICTER)}
            strict |= {name: value for name, value in BETTER.items() if self.values.get(name, value) != value}
            finer = [
                Variation.of({**strict, "dt": times(self.values["dt"], 1.0 / step)}, self.method)
                for step in FINER_STEPS
            ]
            allowed = REFERENCE_SHARE * self.seconds
            affordable = [v for v in finer if self.seconds_of(v, self.last) <= allowed]
            self._ladder = [Variation.of(strict, self.method), *affordable]
        return self._ladder

    @property
    def settled(self) -> bool:
        """Whether no finer reference is to come."""
        return bool(self.ladder()) and all(v in self.done or v in self.closed for v in self.ladder())

    def chosen_reference(self) -> Variation | None:
        """The reference: the finest that was finished."""
        return next((v for v in reversed(self.ladder()) if self.done.get(v, -1) >= (self.last or 0)), None)

    def second_reference(self) -> Variation | None:
        """The one with twice the reference's time step, for the reference's own error."""
        first = self.chosen_reference()
        below = self.ladder()[: self.ladder().index(first)] if first is not None else []
        return below[-1] if below else None

    def wanted(self) -> list[Wanted]:
        """All runs wanted now, the first ones first, finished ones included."""
        last = self.last
        found = [Wanted(self.base, 0, "the scene's settings")]
        found += [Wanted(variation, 0, "a jittered start") for variation in self.jitters]
        if last is None:
            return found
        found.insert(0, Wanted(self.base, last, "the scene's settings"))
        found += [Wanted(variation, last, REFERENCE) for variation in self.ladder()]
        ladder = self.ladder()
        found += [Wanted(variation, last, "one change") for variation in self.singles if variation not in ladder]
        found += [Wanted(variation, last, "a combination") for variation in self._combined]
        return found

    def missing(self) -> list[Wanted]:
        """What is wanted and neither done nor closed."""
        return [
            entry
            for entry in self.wanted()
            if self.done.get(entry.variation, -1) < entry.last and entry.variation not in self.closed
        ]

    def combine(self, measured: Callable[[Variation], tuple[float, float] | None]) -> bool:
        """Add the combinations that the front asks for; False where there is none.

        Parameters
        ----------
        measured : gives (cost, error) of a run on the finest level, None where it has none
        """
        base = measured(self.base)
        if base is None or len(self._combined) >= MOST_COMBINATIONS:
            return False
        axes: dict[str, dict[Any, tuple[float, float]]] = {}
        for axis in self.axes:
            for variation in axis.variations(self.method):
                found = measured(variation) if variation.method == self.method else None
                if found is not None:
                    axes.setdefault(axis.name, {})[variation.changes[0][1]] = found
        points = [found for variation in self.done if (found := measured(variation)) is not None]
        known = {*self.done, *self.closed, *self._combined}
        for _, changes in candidates(base, axes, points):
            variation = Variation.of(changes, self.method)
            if variation not in known:
                self._combined.append(variation)
                return True
        return False

    def expected(self, variation: Variation, last: int) -> float:
        """CPU seconds that a run is expected to take on levels 0 to `last`."""
        base = self.costs.get(self.base, [1.0])
        base = [*base, *([base[-1] * 4.0] * (last + 1 - len(base)))][: last + 1]
        factor = 1.0
        for name, value in variation.changes:
            factor *= self._factor(name, value)
        return float(np.sum(base)) * factor

    def seconds_of(self, variation: Variation, last: int) -> float:
        """[s] that a run is expected to take, on a machine as busy as it was so far."""
        return self.crowding * (START_UP + self.expected(variation, last))

    @property
    def crowding(self) -> float:
        """Seconds of a run in its CPU seconds."""
        return max(CROWDED, self.taken[0] / self.taken[1]) if self.taken[1] > 0.0 else CROWDED

    def observe(self, seconds: float, cpu: float) -> None:
        """Takes note of a run: its seconds, and the CPU seconds of its steps."""
        self.taken = (self.taken[0] + seconds, self.taken[1] + START_UP + cpu)

    def _factor(self, name: str, value: Any) -> float:
        """Of the cost, as measured where it was."""
        alone = Variation.of({name: value}, self.method)
        mine, base = self.costs.get(alone), self.costs.get(self.base)
        if not mine or not base:
            return cost_factor(name, value, self.values.get(name))
        common = min(len(mine), len(base))
        return float(np.sum(mine[:common]) / max(np.sum(base[:common]), 1e-9))
