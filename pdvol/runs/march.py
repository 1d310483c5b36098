"""`pdvol.march`: a scene's levels step by step in memory, with terms and an integrator of the user's own."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI
from threadpoolctl import ThreadpoolController, threadpool_limits

from pdvol.errors import InputError
from pdvol.integrate.integrator import Integrator, Past, advance
from pdvol.integrate.level_march import Lead, level_march
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import LevelModel, level_model
from pdvol.levels.obstacles import placed_obstacles
from pdvol.levels.space import LevelSpace
from pdvol.parallel import end_all, on_root
from pdvol.potentials.build import MakeTerm
from pdvol.potentials.potential import Positions, Term
from pdvol.registry import INTEGRATORS
from pdvol.runs.preparation import prepared_levels
from pdvol.runs.runner import check_choices
from pdvol.scene import Scene
from pdvol.scene.checks import called, count, positive, require
from pdvol.solve.report import StepReport

LEVELS = 'levels is a number (levels 0 to that one), a pair (first, last), a range, or text such as "0:2"'


@dataclass(frozen=True, eq=False, repr=False)
class Step:
    """One step of one level that `march` has made. Arrays are whole on every rank, and not to be written to.

    Attributes
    ----------
    level : its number, 0 the coarsest
    step : the number of the step, from 1
    time : at its end [s]
    positions : (n, d) [m]
        At its end, in the input's order of vertices, as all arrays.
    velocity : (n, d) [m/s]
        At its end, as the integrator gives it.
    forces : dict of (n, d) [N] by name
        What each kind of term and inertia put on the vertices at its end. In the solver's tolerance they sum to zero,
        but for vertices that a support holds: it gives minus the sum. Empty for levels above 0 of the method embedded.
    model : LevelModel
        The scene on the level.
    space : LevelSpace
        The level's dolfinx mesh and function space, and the way between their numbering and the input's.
    report : StepReport
        Iterations, contacts, the smallest gap, energies, seconds and what else the log of a run has.
    """

    level: int
    step: int
    time: float
    positions: np.ndarray
    velocity: np.ndarray
    forces: dict[str, np.ndarray]
    model: LevelModel
    space: LevelSpace
    report: StepReport

    def __repr__(self) -> str:
        return f"Step(level {self.level}, step {self.step}, t = {self.time:g} s)"


def march(
    scene: Scene,
    levels: int | tuple[int, int] | range | str | None = None,
    method: str = "progressive",
    prolongation: str = "barycentric",
    steps: int | None = None,
    terms: Sequence[MakeTerm] = (),
    integrator: Integrator | None = None,
    comm: MPI.Comm | None = None,
) -> "March":
    """A scene's steps, one by one as they are made, coarse to fine; nothing is stored. Collective.

    It is what `run` writes into a folder, with the same numbers. The loop may be left at any time, on all ranks
    together.

    Parameters
    ----------
    scene, levels, method, prolongation, steps, comm : as for `run`
    terms : sequence of callables (LevelModel, LevelSpace) -> Term
        Make further terms of the energy on each level, as classes derived from `Term` do.
    integrator : Integrator, optional
        Instead of the scene's.

    Returns
    -------
    March
        An iterator of `Step`.

    Raises
    ------
    InputError
        Something in the arguments, the scene or its meshes is unfit; in the loop, an own term or integrator is.
    ConvergenceError
        In the loop: a step could not be solved.
    MeshError
        In the loop, after the coarser levels: no mesh came out for a level.
    """
    scene, (first, last) = checked_scene("march", scene, steps), levels_asked(levels)
    last = scene.levels - 1 if last is None else last
    check_choices(scene, first, last, method, prolongation)
    if first > 0 and method != "direct":
        raise InputError(f"level {first} follows from level {first - 1}; begin with levels 0:{last}")
    for make in terms:
        require(callable(make), f"march: terms are functions or classes (model, space) -> Term, not {make!r}")
    return March(scene, range(first, last + 1), method, prolongation, tuple(terms), integrator, comm or MPI.COMM_WORLD)


class March(Iterator[Step]):
    """The steps of a scene's levels, coarse to fine. Construction and steps are collective.

    Parameters
    ----------
    scene, levels, method, prolongation, terms, integrator, comm : as for `march`, which checks them

    Attributes
    ----------
    hierarchy : Hierarchy
        The `LevelSpace` of each level, and the prolongations between them.
    """

    def __init__(
        self,
        scene: Scene,
        levels: range,
        method: str,
        prolongation: str,
        terms: tuple[MakeTerm, ...],
        integrator: Integrator | None,
        comm: MPI.Comm,
    ):
        self._scene, self._levels, self._method = scene, levels, method
        self._terms, self._integrator, self._comm = terms, integrator, comm
        with threadpool_limits(limits=1):
            prepared = on_root(comm, lambda: prepared_levels(scene, levels[-1]))
            self._diagonal, self._refused = prepared.diagonal, prepared.refused
            self._obstacles = placed_obstacles(scene.obstacles, prepared.geometry)
            self.hierarchy = Hierarchy(prepared.meshes, comm, prolongation)
        self._threads, self._steps = ThreadpoolController(), self._all_steps()

    def model(self, level: int) -> LevelModel:
        """The scene on a level of `hierarchy`. Collective."""
        return level_model(self._scene, self.hierarchy, level, self._diagonal, self._obstacles)

    def __next__(self) -> Step:
        with self._threads.limit(limits=1):  # not for the user's own code between steps
            try:
                return next(self._steps)
            except MemoryError:
                end_all(self._comm)
                raise

    def _all_steps(self) -> Iterator[Step]:
        below: list[Past] = []
        for level in self._levels:
            if self._refused is not None and level >= self._refused.level:
                raise self._refused
            model, space = self.model(level), self.hierarchy[level]
            lead = Lead(self.hierarchy, self._method, below.__getitem__)
            integrator = INTEGRATORS[model.integrator]() if self._integrator is None else self._integrator
            start = lead.start(model)
            if self._integrator is not None:
                _try_integrator(integrator, start.past, model.dt)
            terms = [_tried(make, start.past[0].positions) for make in self._terms]
            march = level_march(model, lead, integrator, start, terms, forces=True)
            pasts, anew = [start.past], model.begins_anew
            for report in march:
                for array in (report.positions, report.velocity, *report.forces.values()):
                    array.flags.writeable = False
                struck = report.struck > 0
                pasts.append(advance(integrator, pasts[-1], report.positions, model.dt, anew(report.step), struck))
                at = report.level, report.step, report.time, report.positions, report.velocity, report.forces
                yield Step(*at, model, space, report)
            below = pasts


def _tried(make: MakeTerm, start: np.ndarray) -> MakeTerm:
    """The same, with each term evaluated once at positions (n, d) [m]: InputError where it is unfit."""

    def make_and_try(model: LevelModel, space: LevelSpace) -> Term:
        term = make(model, space)
        require(isinstance(term, Term), f"march: {make!r} gave a {type(term).__name__}, not a pdvol.Term")
        x = Positions(space, space.from_input(start))
        term.begin_step(x, 0.0, model.dt, x)
        value, rows = term.value(x), np.asarray(term.gradient(x))
        wrong = ""
        if np.ndim(value) != 0 or np.asarray(value).dtype.kind not in "fiu":
            wrong = f"value must be a number, not {type(value).__name__}"
        elif rows.shape != x.owned.shape:
            wrong = f"gradient must have the shape {x.owned.shape}, not {rows.shape}"
        found = space.comm.allgather((wrong, None if wrong else float(value)))
        wrong = next((text for text, _ in found if text), "")
        if not wrong and len({energy for _, energy in found}) > 1:
            wrong = "value differs between ranks; sum it up by space.comm.allreduce"
        require(not wrong, f"the term {term.name!r}: {wrong}")
        return term

    return make_and_try


def _try_integrator(integrator: Integrator, past: Past, dt: float) -> None:
    """InputError unless an integrator gives what a step needs."""
    missing = [name for name in ("states", "predict", "weight", "velocity") if not hasattr(integrator, name)]
    require(not missing, f"march: the integrator {type(integrator).__name__} has no {', '.join(missing)}")
    count("integrator.states", integrator.states, 1)
    x = past[0].positions
    called("integrator.predict", integrator.predict, (past, dt), x.shape)
    positive("integrator.weight", float(called("integrator.weight", integrator.weight, (past, dt), ())))
    called("integrator.velocity", integrator.velocity, (x, past, dt), x.shape)


def checked_scene(verb: str, scene: Any, steps: int | None) -> Scene:
    """A scene with so many steps, where they are given; `verb` names the public function."""
    if not isinstance(scene, Scene):
        raise InputError(
            f"pdvol.{verb} takes a pdvol.Scene, not {type(scene).__name__}; scene files run by `pdvol run`"
        )
    return scene if steps is None else replace(scene, steps=steps)


def levels_asked(levels: Any) -> tuple[int, int | None]:
    """First and last level, both included; the finest where the last one is None."""
    if levels is None:
        return 0, None
    if isinstance(levels, str) and (found := re.fullmatch(r"\s*(?:(\d*)\s*:)?\s*(\d*)\s*", levels)) and levels.strip():
        return int(found[1] or 0), int(found[2]) if found[2] else None
    if isinstance(levels, range):
        if len(levels) == 0 or (levels.step != 1 and len(levels) > 1):
            raise InputError(f"levels = {levels!r} must be levels in a row; {LEVELS}")
        return levels[0], levels[-1]
    if _whole(levels):
        return 0, int(levels)
    if isinstance(levels, Sequence | np.ndarray) and len(levels) == 2 and all(_whole(level) for level in levels):
        return int(levels[0]), int(levels[1])
    raise InputError(f"levels = {' '.join(repr(levels).split())} cannot be read; {LEVELS}")


def _whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
