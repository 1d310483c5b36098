"""Scenes of benchmarks.fronts: two of soft cubes of 0.2 m, and shots at random; a scene file. SI units, z up."""

import sys
from pathlib import Path

import numpy as np

import pdvol
from pdvol import Body, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes

sys.path += [str(Path(__file__).resolve().parents[2] / name) for name in ("", "demos")]  # it is no package's part

import recipes
from benchmarks.common.scenes import falling, named

SIDE, GAP, SLOPE = 0.2, 0.02, np.radians(20.0)
"""Side of the cubes [m], gap between those of the tower [m], and the angle of the slope."""
SOFT = NeoHookean(1e5, 0.4, 1000.0)


def sliding_block(cuts=(2, 4, 8)) -> Scene:
    """A cube slides down a slope of 20 degrees with friction of 0.2, and so gains 1.5 m/s^2. The slope is level here,
    and gravity is tilted.
    """
    place, down = Placement((0.0, 0.0, SIDE / 2 + 4e-4)), Gravity((9.81 * np.sin(SLOPE), 0.0, -9.81 * np.cos(SLOPE)))
    return on_a_plane("slope", cuts, {"cube": place}, 0.2, down)


def tower(cuts=(2, 4)) -> Scene:
    """Five cubes fall on each other from 2 cm gaps, each turned a little against the one below; the tower stands."""
    places = {
        f"cube {i + 1}": Placement((0.0, 0.0, SIDE / 2 + GAP + i * (SIDE + GAP)), angle=0.3 * i) for i in range(5)
    }
    return on_a_plane("floor", cuts, places, 0.4, Gravity((0.0, 0.0, -9.81)))


def on_a_plane(name: str, cuts, places: dict[str, Placement], mu: float, load: Gravity) -> Scene:
    """Cubes of several levels above a plane."""
    shape = tuple(meshes.brick((SIDE, SIDE, SIDE), (n, n, n)) for n in cuts)
    plane = Plane((0.0,) * 3, (0.0, 0.0, 1.0), name=name)
    bodies = (Body(shape, SOFT, name=name, placement=place) for name, place in places.items())
    return falling(bodies, 100, mu=mu, loads=(load,), obstacles=(plane,))


SHAPES = {
    "disc": (2, lambda r: meshes.disc(r)),
    "worm": (2, lambda r: recipes.worm(3.0 * r, 0.6 * r)),
    "comb": (2, lambda r: meshes.comb(4, 2.0 * r, 0.25 * r, 0.2 * r, 0.4 * r)),
    "ball": (3, lambda r: meshes.solids.ball(r)),
    "torus": (3, lambda r: meshes.torus(r, 0.35 * r)),
    "bunny": (3, lambda r: meshes.bunny(2.0 * r)),
}
VERTICES = {2: (60, 200), 3: (100, 300)}


def random_shot(seed=0, steps=80, dt=0.01) -> Scene:
    """One body above the ground, a round stone below it in half of the shots: shape, stiffness, throw, spin, friction
    and ground follow from a number.
    """
    draw = np.random.default_rng([7, seed])
    dim, shape = SHAPES[list(SHAPES)[draw.integers(len(SHAPES))]]
    radius = float(draw.uniform(0.1, 0.4))
    up = np.eye(dim)[-1]
    velocity = np.append(draw.uniform(-1.5, 1.5, dim - 1), draw.uniform(-1.0, 1.0))
    spin = float(draw.uniform(-4.0, 4.0)) if dim == 2 else tuple(draw.uniform(-4.0, 4.0, 3))
    height = float(draw.uniform(4.5, 6.0)) * radius
    stone = meshes.disc(0.5 * radius, 48) if dim == 2 else meshes.solids.ball(0.5 * radius, 2)
    stones = draw.uniform() < 0.5
    material = NeoHookean(float(10.0 ** draw.uniform(4.3, 5.5)), float(draw.uniform(0.2, 0.45)), 1000.0)
    place = Placement(tuple(height * up), angle=float(draw.uniform(0.0, 1.0)))
    body = Body(shape(radius), material, VERTICES[dim], "body", placement=place, velocity=tuple(velocity), spin=spin)
    obstacles = [Plane((0.0,) * dim, tuple(up), name="ground")]
    if stones:
        obstacles.append(Rigid(stone, name="stone", placement=Placement(tuple(0.52 * radius * up))))
    mu, down = float(draw.uniform(0.0, 0.6)), Gravity(tuple(-9.81 * up))
    return falling([body], steps, dt, mu, loads=(down,), obstacles=tuple(obstacles))


SCENES = {"random_shot": random_shot, "sliding_block": sliding_block, "tower": tower}


def scene(name: str = "random_shot", **other) -> Scene:
    """One of `SCENES`, with what its function takes."""
    return named(SCENES, name, **other)


if __name__ == "__main__":
    pdvol.main(scene)
