"""A term and integrators that a user might write, for tests of `pdvol.march`."""

from dataclasses import replace

import numpy as np
import small

import pdvol
from pdvol.geometry.level_mesh import lumped_masses

RATE = 6.0  # 1/s


class Hand(pdvol.Term):
    """Springs between all vertices and a hand that moves, as stiff as these are heavy: E = rate^2 / 2 |x - goal|^2_M.

    A body that is alone with it moves as one point with the frequency `rate`.
    """

    name = "hand"

    def __init__(self, model: pdvol.LevelModel, space: pdvol.LevelSpace):
        masses = lumped_masses(model.mesh, model.materials.density)
        self.space, self.goal = space, space.from_input(model.start)
        self.start, self.stiffness = self.goal, RATE**2 * space.from_input(masses)[:, None]

    def begin_step(self, x_t, t0, t1, x_hat=None):
        self.goal = self.start + 0.1 * t1 * np.eye(self.space.dim)[0]

    def value(self, x):
        return self.space.comm.allreduce(0.5 * np.sum(self.stiffness * (x.owned - self.goal) ** 2))

    def gradient(self, x):
        return self.stiffness * (x.owned - self.goal)

    def add_hessian(self, x, weight, into):
        into.add_diagonal(np.arange(len(x.owned)), weight * self.stiffness[:, :, None] * np.eye(self.space.dim))


class DampedEuler:
    """Implicit Euler with a force -c M v."""

    states = 1

    def __init__(self, c: float):
        self.c = c

    def predict(self, past, dt):
        return past[0].positions + dt * past[0].velocity / (1.0 + self.c * dt)

    def weight(self, past, dt):
        return dt**2 / (1.0 + self.c * dt)

    def velocity(self, positions, past, dt):
        return (positions - past[0].positions) / dt


class Parabola:
    """x+ = x + dt v + dt^2 / 2 a(x+), v+ = v + dt a(x+): exact where the acceleration a is constant."""

    states = 1

    def predict(self, past, dt):
        return past[0].positions + dt * past[0].velocity

    def weight(self, past, dt):
        return dt**2 / 2.0

    def velocity(self, positions, past, dt):
        return 2.0 * (positions - past[0].positions) / dt - past[0].velocity


def marched(comm) -> dict:
    """What a march with them gives, by name."""
    scene = replace(small.scene(), solver=pdvol.Solver(tolerance=1e-9, linear="direct"))
    steps = list(pdvol.march(scene, terms=(Hand,), steps=3, comm=comm))
    arrays = {f"{s.level}_{s.step}_{name}": rows for s in steps for name, rows in s.forces.items()}
    return arrays | {f"{s.level}_{s.step}": s.positions for s in steps}
