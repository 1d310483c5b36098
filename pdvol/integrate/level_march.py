"""The march of one level by any method: what `pdvol.march` gives to its caller, and `pdvol.run` to a folder."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pdvol.integrate.feedback import level_feedback
from pdvol.integrate.integrator import Integrator, Past
from pdvol.integrate.long_step import Show
from pdvol.integrate.marches import Start, direct, embedded, guide, progressive
from pdvol.integrate.stepper import FromCoarser, Stepper
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.initial_state import count_intersections
from pdvol.levels.model import LevelModel
from pdvol.potentials.build import MakeTerm
from pdvol.solve.report import StepReport

Coarse = Callable[[int], Past]
"""The past of the level below after so many steps, as its positions at the ends of steps show it."""


@dataclass(frozen=True, eq=False)
class Lead:
    """How a level follows the one below.

    Attributes
    ----------
    method : one of `pdvol.registry.METHODS`
    coarse : is called for a state of the level below when a step needs it
    """

    hierarchy: Hierarchy
    method: str
    coarse: Coarse

    def positions(self, step: int) -> np.ndarray:
        """(n, d) [m] of the level below after so many steps."""
        return self.coarse(step)[0].positions

    def start(self, model: LevelModel) -> Start:
        """A level begins where the scene says; an embedded one where the level below does, prolonged. Collective."""
        begin = model.start
        if self.method == "embedded" and model.level > 0 and begin is not model.mesh.points:
            begin = self.hierarchy.prolongation(model.level).prolong(self.positions(0))
        return Start.at_rest(begin, model.velocity)


def level_march(
    model: LevelModel,
    lead: Lead,
    integrator: Integrator,
    start: Start,
    terms: Sequence[MakeTerm] = (),
    forces: bool = False,
    show: Show | None = None,
) -> Iterator[StepReport]:
    """The steps of a level from its start to the scene's last one, made one by one. Collective.

    Parameters
    ----------
    terms, forces, show : as `Stepper` takes them
    """
    level, steps, dt, hierarchy, method = model.level, model.steps, model.dt, lead.hierarchy, lead.method
    if method == "embedded" and level > 0:
        count = {"count": partial(_count_intersections, model)} if model.contact else {}
        return embedded(hierarchy.prolongation(level), lead.positions, level, start, steps, dt, integrator, **count)
    weight = model.penalty.of(method) if level > 0 else 0.0
    guides = (guide(weight, dt, hierarchy.prolongation(level), lead.positions),) if weight > 0.0 else ()
    feedback = level_feedback(model, hierarchy, method, lead.positions)
    coarser = FromCoarser(partial(hierarchy.coarse_weights, level), guides, feedback)
    stepper = Stepper(model, hierarchy[level], coarser, integrator, terms, forces, show)
    if method == "progressive" and level > 0:
        return progressive(stepper, hierarchy.prolongation(level), lead.coarse, start, steps)
    return direct(stepper, start, steps)


def _count_intersections(model: LevelModel, positions: np.ndarray, time: float) -> int:
    places = {obstacle: obstacle.place(time) for obstacle in model.obstacles}
    return count_intersections(model.mesh, positions, model.obstacles, model.bodies, places)
