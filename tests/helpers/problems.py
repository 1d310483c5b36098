"""Small one-level problems for the tests, from grids instead of shapes."""

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI

from pdvol.integrate.integrator import State
from pdvol.integrate.stepper import Stepper
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.initial_state import find_defects
from pdvol.levels.materials import cell_materials
from pdvol.levels.model import LevelModel, level_model
from pdvol.levels.obstacles import placed_obstacles
from pdvol.levels.space import LevelSpace
from pdvol.potentials.elasticity import elastic_terms
from pdvol.scene import Body, Gravity, NeoHookean, Plane, Rigid, Scene, Solver, Still
from pdvol.solve.report import StepReport
from shapes import grid

SOFT = NeoHookean(young=1e5, poisson=0.4, density=1000.0)


def block(low, high, n, jitter=0.0, seed=0):
    """A box between two corners, n boxes along its axes (a number or one per axis)."""
    n = np.broadcast_to(n, len(low))
    return grid(*(np.linspace(a, b, k + 1) for a, b, k in zip(low, high, n, strict=True)), jitter=jitter, seed=seed)


def make_scene(materials=(SOFT,), dt=0.01, steps=10, solver=None, **physics) -> Scene:
    """A scene of one body per material, whose shapes are never read: the level is given to the problem. By default it
    has linear elements and implicit Euler, for which physics is derived by hand.
    """
    bodies = tuple(Body(("grid",), material, name=f"body {i}") for i, material in enumerate(materials))
    solver = solver or Solver(tolerance=1e-6, linear="direct")
    physics = {"integrator": "implicit_euler", "elements": "linear", "feedback": 0.0} | physics
    return Scene(bodies, dt=dt, steps=steps, solver=solver, **physics)


def elastic(space, *materials, elements="linear"):
    """The elastic terms of a level whose bodies are of these materials, one per body."""
    return elastic_terms(space, cell_materials(make_scene(materials, elements=elements), space.mesh))


def weight(d, g=9.81) -> Gravity:
    """Gravity down the last axis."""
    return Gravity(tuple(-g * np.eye(d)[-1]))


def ground(d, kind="plane", height=0.0, motion=Still()):  # noqa: B008
    """An obstacle named floor, whose upper side is at a height [m]: a plane, or something rigid and wide. And its
    geometry, as `make_model` takes it.
    """
    if kind == "plane":
        return Plane((0.0,) * (d - 1) + (height,), tuple(np.eye(d)[-1]), motion, name="floor"), ()
    corners = [[-5, -1], [5, -1], [5, 0], [-5, 0]] if d == 2 else [[0, 0, -5], [-5, -5, 0], [10, -5, 0], [0, 10, 0]]
    shape = (polyline if d == 2 else tetrahedron)(np.array(corners) + height * np.eye(d)[-1])
    return Rigid("floor", motion=motion, name="floor"), (shape,)


def fail_solve(monkeypatch, stepper, number) -> list[float]:
    """Newton's solve of this number, counted from one, does not converge. The list gets the weight of each solve."""
    solve, weights = stepper.newton.solve, []

    def fails_once(x, *choices, **more):
        x, report = solve(x, *choices, **more)
        weights.append(stepper.potential.weight)
        report.converged = report.converged and len(weights) != number
        return x, report

    monkeypatch.setattr(stepper.newton, "solve", fails_once)
    return weights


def make_model(scene, mesh, obstacles=()) -> LevelModel:
    """A scene on a mesh; `obstacles` is the geometry of its `Rigid` ones."""
    return level_model(scene, Hierarchy([mesh], MPI.COMM_SELF), 0, 1.0, placed_obstacles(scene.obstacles, obstacles))


def make_stepper(scene, mesh, obstacles=(), comm=MPI.COMM_WORLD, integrator=None, forces=False) -> Stepper:
    return Stepper(make_model(scene, mesh, obstacles), LevelSpace(mesh, comm), integrator=integrator, forces=forces)


def take_step(stepper, number, positions, velocity) -> StepReport:
    """One step from positions (n, d) with velocity (n, d)."""
    return stepper.step(number, (State(positions, velocity),))


def march(stepper, steps, positions=None, velocity=None, first=1) -> Iterator[StepReport]:
    """Steps of implicit Euler from the mesh's positions, and from rest, unless they are given."""
    x = stepper.space.mesh.points if positions is None else positions
    v = np.zeros_like(x) if velocity is None else velocity
    for number in range(first, first + steps):
        report = take_step(stepper, number, x, v)
        x, v = report.positions, (report.positions - x) / stepper.model.dt
        report.velocity = v
        yield report


def masses(problem) -> np.ndarray:
    """(n,) lumped masses [kg] in the input's order."""
    return problem.space.to_input(problem.potential.mass)[:, 0]


def polyline(vertices):
    """A closed 2D obstacle's geometry, as `make_model` takes it."""
    n = len(vertices)
    return (
        np.asarray(vertices, dtype=float),
        np.column_stack([np.arange(n), np.roll(np.arange(n), -1)]),
        np.zeros((0, 3), dtype=int),
    )


def spike(tip):
    """The geometry of an obstacle, 0.2 m high, with its tip at a point (d,)."""
    foot = [[-0.1, -0.2], [0.1, -0.2]] if len(tip) == 2 else [[-0.1, -0.1, -0.2], [0.3, -0.1, -0.2], [-0.1, 0.3, -0.2]]
    return (polyline if len(tip) == 2 else tetrahedron)([*(np.array(foot) + tip), tip])


def tetrahedron(vertices):
    """A rigid tetrahedron's geometry, as `make_model` takes it."""
    edges = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
    return np.asarray(vertices, dtype=float), edges, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def check_start(levels, scene):
    """Raises the first defect of some level of a scene at t = 0."""
    obstacles, names = placed_obstacles(scene.obstacles), [body.name for body in scene.bodies]
    for number, mesh in enumerate(levels):
        for defect in find_defects(number, mesh, obstacles, names, levels):
            raise defect.error
