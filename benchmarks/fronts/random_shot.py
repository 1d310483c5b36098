"""A shot that follows from a number: shape, stiffness, throw, spin, friction and ground are drawn at random."""

import sys
from pathlib import Path

import numpy as np

import pdvol
from pdvol import Body, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes

sys.path += [str(Path(__file__).resolve().parents[2] / name) for name in ("", "demos")]  # it is no package's part

import recipes
from benchmarks.common.scenes import falling

SHAPES = {
    "disc": (2, lambda r: meshes.disc(r)),
    "worm": (2, lambda r: recipes.worm(3.0 * r, 0.6 * r)),
    "comb": (2, lambda r: meshes.comb(4, 2.0 * r, 0.25 * r, 0.2 * r, 0.4 * r)),
    "ball": (3, lambda r: meshes.solids.ball(r)),
    "torus": (3, lambda r: meshes.torus(r, 0.35 * r)),
    "bunny": (3, lambda r: meshes.bunny(2.0 * r)),
}
VERTICES = {2: (60, 200), 3: (100, 300)}


def scene(seed=0, steps=80, dt=0.01) -> Scene:
    """One body above the ground, a round stone below it in half of the shots."""
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


if __name__ == "__main__":
    pdvol.main(scene)
