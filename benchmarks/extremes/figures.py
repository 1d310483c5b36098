"""What some rows of the envelope are about beside the columns of its table: measured from stored states, beside what
theory gives for it.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from benchmarks.common import trials
from benchmarks.extremes import scenes
from pdvol.scene import Friction, metres
from pdvol.store.reader import Run, open_run


def figure(name: str, path: Path) -> str:
    """What row `name` is about, from its run folder; empty where it has nothing of its own, or no state."""
    run = open_run(path)
    return FIGURES[name](run) if name in FIGURES and run.levels[0].steps > 1 else ""


def angular_momentum(run: Run, step: int) -> np.ndarray:
    """(3,) of the finest level's vertices about their centre of mass [kg m^2 / s], with the mean velocities over the
    step; those of the scene at step 0.
    """
    level, masses = run.levels[-1], trials.masses(run, run.levels[-1])
    x, v = level.positions(step), level.velocities(step)
    return np.cross(x - np.average(x, axis=0, weights=masses), v).T @ masses


def lost_spin(run: Run, spin: float, integrator: str) -> tuple[float, float]:
    """Shares lost of the angular momentum of a body that began with `spin` [rad/s]: measured, and that of a rigid
    body.
    """
    steps = run.levels[-1].steps - 1
    before, after = (np.linalg.norm(angular_momentum(run, step)) for step in (0, steps))
    return float(1.0 - after / before), rigid_loss(integrator, spin * run.dt, steps)


def rigid_loss(integrator: str, turn: float, steps: int) -> float:
    """The fraction of its angular momentum that a rigid body loses, which turns freely about a principal axis, by
    `turn` [rad] in the first step if nothing was lost.

    Positions are x_n = exp(i theta_n), in units of dt. Forces between its points have no torque, so that each step
    solves Im(conj(x_{n+1}) a_{n+1}) = 0 for the angle, with the integrator's acceleration a_{n+1}. BDF2's first step is
    one of implicit Euler. Velocities are differences over the last step, as run folders have them.
    """
    x, v = [1.0 + 0.0j], [1j * turn]
    for step in range(steps):
        bdf2 = integrator == "bdf2" and step > 0
        angle = brentq(_torque, 0.0, 1.5 * turn, args=(x, v, bdf2), xtol=1e-15)
        y = x[-1] * np.exp(1j * angle)
        v.append(_velocity(y, x, bdf2))
        x.append(y)
    return float(1.0 - np.sin(np.angle(x[-1] / x[-2])) / turn)


def _velocity(y: complex, x: list[complex], bdf2: bool) -> complex:
    return (3.0 * y - 4.0 * x[-1] + x[-2]) / 2.0 if bdf2 else y - x[-1]


def _torque(angle: float, x: list[complex], v: list[complex], bdf2: bool) -> float:
    y = x[-1] * np.exp(1j * angle)
    now = _velocity(y, x, bdf2)
    return float((np.conj(y) * ((3.0 * now - 4.0 * v[-1] + v[-2]) / 2.0 if bdf2 else now - v[-1])).imag)


def creep(run: Run) -> tuple[float, float, float]:
    """Speeds [m/s] of the cube on the slope over the last third of the run: downhill, across, and downhill as the
    smoothing of friction gives it, eps_v (1 - (1 - tan / mu)^(1/2)).
    """
    level, last = run.levels[-1], run.levels[-1].steps - 1
    first = last - last // 3
    ends = [level.positions(step).mean(axis=0) for step in (first, last)]
    moved = (ends[1] - ends[0]) / (run.dt * (last - first))
    eps_v = metres(Friction(scenes.HOLD).eps_v, run.info["diagonal"])
    fraction = scenes.SLOPE / scenes.HOLD
    return float(moved[0]), float(moved[2]), eps_v * (1.0 - np.sqrt(1.0 - fraction))


def _spin_line(run: Run, spin: float, integrator: str) -> str:
    lost, rigid = lost_spin(run, spin, integrator)
    return f"loses {100 * lost:.3g} % of its angular momentum, a rigid body would lose {100 * rigid:.3g} %"


def _creep_line(run: Run) -> str:
    down, across, expected = (1e3 * speed for speed in creep(run))
    return f"creeps {down:.4g} mm/s downhill, {expected:.4g} by the smoothing, and {across:.2g} mm/s across"


FIGURES: dict[str, Callable[[Run], str]] = {
    "slope_sticks": _creep_line,
    "spin_2": partial(_spin_line, spin=2.0, integrator="implicit_euler"),
    "spin_30": partial(_spin_line, spin=30.0, integrator="implicit_euler"),
    "spin_2_bdf2": partial(_spin_line, spin=2.0, integrator="bdf2"),
    "spin_30_bdf2": partial(_spin_line, spin=30.0, integrator="bdf2"),
}
"""Functions of a run by row."""
