"""Terms of a level evaluated at stored states, as in the step that led there: for exports and measures."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pdvol.levels.model import LevelModel
from pdvol.levels.script import Script
from pdvol.levels.space import LevelSpace
from pdvol.potentials.build import build_terms
from pdvol.potentials.consistency import Guide
from pdvol.potentials.potential import Positions, Potential


class Replay:
    """The terms of a level, put to the end of one stored step after the other. Construction is collective.

    Friction is lagged at the step's start, as its first iteration is.

    Attributes
    ----------
    terms : all potentials
    contacts : those of barriers and friction
    mass : (n_owned, d) [kg]
    """

    def __init__(self, model: LevelModel, space: LevelSpace, guides: Sequence[Guide] = ()):
        self._script = Script(model.supports, model.obstacles, model.ground)
        built = build_terms(model, space, guides, self._script)
        self.space, self.dt, self.mass, self.terms = space, model.dt, built.mass, built.potentials
        self.contacts = tuple(term for term in self.terms if term.name in ("barrier", "friction"))

    def put(
        self,
        step: int,
        start: np.ndarray,
        end: np.ndarray,
        behind: tuple[float, float] = (0.0, 0.0),
        joined: int = 1,
        memory: Mapping[str, Mapping] | None = None,
        late: tuple[Mapping[str, float], Mapping[str, float]] = ({}, {}),
    ) -> Positions:
        """Puts all terms to the end of a stored step, and returns its positions. Collective.

        Parameters
        ----------
        step : its number; 0 stands for the initial state, where nothing slides
        start, end : (n, d) positions [m] in the input's order
        behind : [s] how far obstacles were behind the time at the step's start and end
        joined : how many steps were solved as this one, which began where the first of them did
        memory : `terms` of the log's record of the step before, where there is one
        late : the same as `behind` by motions, as the log has it, where it has it
        """
        for term in self.terms:
            term.restore((memory or {}).get(term.name, {}))
        x_t, x = (Positions(self.space, self.space.from_input(rows)) for rows in (start, end))
        t0, t1 = max(step - joined, 0) * self.dt, step * self.dt
        start_lags, end_lags = (self._script.recorded_lags(b, each) for b, each in zip(behind, late, strict=True))
        self._script.begin(t0, t0 + joined * self.dt, start_lags)
        # All terms begin before any moves on: friction lags on barriers that are still where the step begins.
        for term in self.terms:
            term.begin_step(x_t, t0, t0 + joined * self.dt)
        self._script.begin(t1, t1 + self.dt, end_lags)
        for term in self.terms:
            term.move_obstacles(t1)
        return x

    def force(self, x: Positions, terms: Iterable[Potential]) -> np.ndarray:
        """(n_owned, d) [N]: minus the gradient of some of the terms at x."""
        return -sum((term.gradient(x) for term in terms), start=np.zeros_like(x.owned))
