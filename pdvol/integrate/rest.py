"""Steps at rest: where nothing moves visibly, nor would soon, nothing is solved, and the next solve is one longer step.

Let v be the velocities at the last solved state x, and a the accelerations by which its solve changed them: with the
prediction x_hat and the weight w of the forces, a = (x - x_hat) / w = -M^-1 dE/dx(x), but for Newton's residual. Drift
feedback (`feedback.py`) counts as a force: its acceleration is added to a, and so is what it gains meanwhile. As long
as nothing scripted changes, a state that is held at x for a time T lacks

    T v in positions,    T a in velocities.

It is held while the first is shorter than the solver's tolerance times dt, the size of the steps at which Newton stops,
and the second is slower than the tolerance. Nothing is evaluated meanwhile. Then one step of implicit Euler leads from
x and v over all the time since. So no motion is lost, however slow: a slope starts to slide, a creeping body creeps,
and free fall over tiny steps becomes free fall.
"""

from collections.abc import Callable, Mapping

import numpy as np
from mpi4py import MPI

from pdvol.integrate.integrator import State
from pdvol.levels.model import LevelModel
from pdvol.potentials.potential import Positions
from pdvol.scene import Force, Gravity, Impulse, Load, PointForce, Pressure
from pdvol.solve.incremental_potential import IncrementalPotential


class Rest:
    """How long the last solved state is held.

    Parameters
    ----------
    model : LevelModel
    tolerance : speed [m/s]

    Attributes
    ----------
    steps : since the last solve
    acceleration : the largest at the last solved state [m/s^2]; inf where that moves too fast to be held
    """

    def __init__(self, model: LevelModel, tolerance: float):
        self._loads, self._dt, self._tolerance = [placed.load for placed in model.loads], model.dt, tolerance
        working = any(callable(placed.muscle.activation) for placed in model.muscles)
        self._changing = working or bool(model.materials.keyed)
        self.steps, self.acceleration = 0, np.inf

    @property
    def memory(self) -> dict[str, float]:
        """What the next step needs to know, as the log keeps it; empty where the state is not held."""
        return {"steps": self.steps, "acceleration": self.acceleration} if np.isfinite(self.acceleration) else {}

    def restore(self, memory: Mapping[str, float]) -> None:
        """Sets what `memory` gave."""
        self.steps, self.acceleration = int(memory.get("steps", 0)), memory.get("acceleration", np.inf)

    def lasts(self, state: State, time: float, added: float = 0.0) -> bool:
        """Whether a step from `time` [s] on may end where it begins, at the last solved state; it is counted.

        Parameters
        ----------
        added : acceleration [m/s^2] that the feedback has gained since that state, at most
        """
        held = (self.steps + 1) * self._dt
        fastest = float(np.linalg.norm(state.velocity, axis=1).max())
        lasts = (
            held * (self.acceleration + added) <= self._tolerance
            and held * fastest <= self._dt * self._tolerance
            and not self._changing
            and all(_is_constant(load, time) for load in self._loads)
        )
        self.steps += lasts
        return lasts

    def begin(
        self,
        potential: IncrementalPotential,
        x: Positions,
        fixed: np.ndarray,
        speed: float,
        acting: Callable[[], np.ndarray] = lambda: np.zeros(1),
    ) -> None:
        """Begins anew at x, which a step has led to that was nowhere faster than `speed` [m/s]. Vertices `fixed`
        (n_owned,) are held by supports. `acting` gives the feedback's acceleration (n_owned, d) [m/s^2] at x, which is
        asked for where x may be held. Collective.
        """
        self.steps, self.acceleration = 0, np.inf
        if speed <= self._tolerance:
            changes = np.linalg.norm(x.owned - potential.x_hat + potential.weight * acting(), axis=1)[~fixed]
            largest = float(changes.max(initial=0.0)) / potential.weight
            self.acceleration = x.space.reduce(largest, MPI.MAX)


def _is_constant(load: Load, time: float) -> bool:
    """Whether a load stays as it is from `time` [s] on, whatever bodies do."""
    match load:
        case Gravity(acceleration=vector) | Force(force=vector) | PointForce(force=vector):
            return not callable(vector)
        case Pressure(pressure=value):
            return not callable(value)
        case Impulse(time=at):
            return at < time
    return False
