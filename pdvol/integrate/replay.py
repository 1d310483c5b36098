"""Terms of a level evaluated at stored states, as in the step that led there: for exports and measures."""

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from pdvol.integrate.integrator import Past, rates_of
from pdvol.levels.model import LevelModel
from pdvol.levels.script import Script
from pdvol.levels.space import LevelSpace
from pdvol.potentials.build import build_terms
from pdvol.potentials.consistency import Guide
from pdvol.potentials.potential import Positions, Term, by_names
from pdvol.registry import INTEGRATORS

Lateness = tuple[float, Mapping[str, float]]
"""How far obstacles were behind the time [s]: all of them, or by their names, as the log has it."""


class Replay:
    """The terms of a level, put to the end of one stored step after the other. Construction is collective.

    Friction is lagged at the step's start, as its first iteration is. Where it acts at a scene's start, to which no
    solve has led, that of the first step is lagged at its end.

    Attributes
    ----------
    integrator : Integrator
    terms : all potentials
    contacts : those of barriers and friction
    mass : (n_owned, d) [kg]
    """

    def __init__(self, model: LevelModel, space: LevelSpace, guides: Sequence[Guide] = ()):
        self.integrator = INTEGRATORS[model.integrator]()
        self._script = Script(model.supports, model.obstacles, model.ground)
        built = build_terms(model, space, guides, self._script)
        self.space, self.dt, self.mass, self.terms = space, model.dt, built.mass, built.potentials
        self.contacts = tuple(term for term in self.terms if term.name in ("barrier", "friction"))

    def put(
        self,
        step: int,
        past: Past,
        end: np.ndarray,
        memory: Mapping[str, Mapping] | None = None,
        late: Callable[[int], Lateness] = lambda step: (0.0, {}),
    ) -> Positions:
        """Puts all terms to the end of a stored step, and returns its positions. Collective.

        Parameters
        ----------
        step : its number; 0 stands for the initial state, where nothing slides
        past : the last states at its start, in the input's order
        end : (n, d) positions [m], the same
        memory : `terms` of the log's record of the step before, where there is one
        late : step -> how late obstacles were at its end
        """
        for name, term in by_names(self.terms).items():
            term.restore((memory or {}).get(name, {}))
        x_t, x = (Positions(self.space, self.space.from_input(rows)) for rows in (past[0].positions, end))
        before = max(step - 1, 0)
        t0, t1 = before * self.dt, step * self.dt
        lags = lambda step: self._script.recorded_lags(*late(max(step, 0)))
        earlier = tuple(lags(before - number) for number in range(1, len(past)))
        rates, end_lags = rates_of(self.integrator, past, self.space, t0, self.dt, earlier), lags(step)
        self._script.begin(t0, t0 + self.dt, lags(before))
        # All terms begin before any moves on: friction lags on barriers that are still where the step begins.
        for term in self.terms:
            term.begin_step(x_t, t0, t0 + self.dt)
            if rates is not None:
                term.set_rates(rates)
        first_lag = before == 0 and any(term.has_friction for term in self.terms)
        self._script.begin(t1, t1 + self.dt, end_lags)
        for term in self.terms:
            term.move_obstacles(t1)
        if first_lag:
            for term in self.terms:
                term.update_lag(x)
        return x

    def force(self, x: Positions, terms: Iterable[Term]) -> np.ndarray:
        """(n_owned, d) [N]: minus the gradient of some of the terms at x."""
        return -sum((term.gradient(x) for term in terms), start=np.zeros_like(x.owned))
