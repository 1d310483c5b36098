"""Scenes of dense contact; a scene file.

    ./run pdvol run benchmarks/common/scenes/piles.py --set name=stack

SI units, y up, with the material, contact distance and tolerance of the peers' scenes (peers.py).

Balls and animals have the meshes that 97e899e made of them (meshes.npz), so that all commits march the same ones.
"""

import sys
from pathlib import Path

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, NeoHookean, Placement, Plane, Rigid, Rotation, Scene, Solver, Translation
from pdvol.meshes import Solid, ball, bowl, brick, cylinder
from pdvol.meshing.build import build_levels

sys.path.append(str(Path(__file__).resolve().parents[3]))  # as a scene file it is no part of a package

from benchmarks.common.scenes import FLOOR, X_AXIS, Z_AXIS, falling, first_order, named, solid
from benchmarks.common.scenes.peers import MATERIAL, PEERS, RUB, of_peers

JELLY = NeoHookean(8e3, 0.42, 1000.0)
"""Of what rollers draw in."""
GAP = 9e-4
"""Metres between faces that touch at the start: nine tenths of the contact distance."""

DIAGONAL = 3.128461310521044
"""Metres: the animals' of jelly_bowl together. 97e899e took its default lengths from it."""


def kept(name: str) -> Solid:
    """A mesh of meshes.npz."""
    with np.load(Path(__file__).with_name("meshes.npz")) as arrays:
        return solid(arrays[f"{name}_points"], arrays[f"{name}_cells"])


def stack(count: int = 5, side: float = 0.2, cuts: int = 7, steps: int = 100) -> Scene:
    """Cubes on the floor, face on face, their meshes alike: most edges of two faces are parallel."""
    cube = brick((side, side, side), (cuts, cuts, cuts))
    places = [Placement((0.0, GAP + side / 2 + k * (side + GAP), 0.0)) for k in range(count)]
    bodies = (Body((cube,), MATERIAL, name=f"cube {k}", placement=place) for k, place in enumerate(places))
    return of_peers(bodies, steps, RUB)


def balls(across: int = 3, radius: float = 0.1, steps: int = 80) -> Scene:
    """across^3 balls fall between four walls onto the floor and each other, at 2 m/s from the start."""
    pitch, dice = 2.3 * radius, np.random.default_rng(19)
    wall = across / 2 * pitch + 0.1 * radius
    shape, bodies = kept("ball"), []
    for place in np.ndindex(across, across, across):
        centre = pitch * (np.array(place) - [(across - 1) / 2, -0.6, (across - 1) / 2])
        centre += 0.1 * radius * dice.uniform(-1.0, 1.0, 3)
        at, name = Placement(tuple(centre)), f"ball {len(bodies)}"
        bodies.append(Body((shape,), MATERIAL, name=name, placement=at, velocity=(0.0, -2.0, 0.0)))
    walls = tuple(
        Plane(tuple(-wall * n), tuple(n), name=f"wall {k}")
        for k, n in enumerate(side * np.eye(3)[axis] for axis in (0, 2) for side in (-1.0, 1.0))
    )
    return of_peers(bodies, steps, RUB, obstacles=(FLOOR, *walls))


def plates(cuts: int = 15, fraction: float = 0.4, steps: int = 40) -> Scene:
    """A block of 0.5 m is pressed between two plates that close by `fraction` of its height, at the same speed all the
    time.
    """
    side, dt = 0.5, 0.01
    speed = (fraction * side + 2 * GAP) / (steps * dt)
    bottom = Plane((0.0, -side / 2 - GAP, 0.0), (0.0, 1.0, 0.0), name="bottom")
    top = Plane((0.0, side / 2 + GAP, 0.0), (0.0, -1.0, 0.0), Translation((0.0, -speed, 0.0)), "top")
    block = Body((brick((side, side, side), (cuts, cuts, cuts)),), MATERIAL, name="block")
    return of_peers([block], steps, RUB, dt=dt, loads=(), obstacles=(bottom, top))


def struck(speed: float, away: float = 0.01, cuts: int = 6, steps: int = 20) -> Scene:
    """A rigid ball of radius 0.1 m, moving at `speed` [m/s] along x, meets a free cube of 0.3 m; there is nothing
    else.
    """
    radius, side = 0.1, 0.3
    cube = Body((brick((side, side, side), (cuts, cuts, cuts)),), NeoHookean(1e5), name="cube")
    start, way = Placement((-side / 2 - radius - away, 0.0, 0.0)), Translation((float(speed), 0.0, 0.0))
    hammer = Rigid(ball(radius, 3), start, way, name="ball")
    return Scene((cube,), dt=0.01, steps=steps, obstacles=(hammer,), contact=(Barrier(),))


def jelly_bowl(steps: int = 60) -> Scene:
    """Level 0 of demos/jelly_bowl.py: three animals of some 530 vertices, thrown into a glass bowl at 6 m/s."""
    thrown = (
        ("bear", (0.62, -0.78, -0.02), (0.0, 2.0, -4.0)),
        ("bunny", (-0.60, -0.80, -0.12), (3.0, 0.0, 4.0)),
        ("frog", (0.0, -0.93, 0.36), (-4.0, 0.0, 1.0)),
    )
    jelly, length = NeoHookean(6e4, 0.45, 1000.0), 1e-3 * DIAGONAL
    bodies = (
        Body((kept(name),), jelly, name=name, spin=spin, velocity=tuple(6.0 * part for part in way))
        for name, way, spin in thrown
    )
    contact, solver = (Barrier(dhat=length), Friction(0.05, eps_v=length)), Solver(tolerance=length)
    return falling(bodies, steps, obstacles=(Rigid(bowl(1.0, 0.6, 0.05), name="bowl"),), contact=contact, solver=solver)


def rollers(gap: float = 0.12, turns: float = 0.8, steps: int = 60, body: Body | None = None, **more) -> Scene:
    """A soft block of 0.2 x 0.4 x 0.3 m, or another body, is drawn through two rollers `gap` [m] apart that turn
    `turns` [1/s].
    """
    radius = 0.16
    block = Body((brick((0.2, 0.4, 0.3), (4, 8, 6)),), JELLY, name="block", placement=Placement((0.0, 0.37, 0.0)))

    def roller(side: int) -> Rigid:
        centre = (side * (radius + gap / 2), 0.0, 0.0)
        turning = Rotation(side * 2.0 * np.pi * turns, centre, Z_AXIS)
        return Rigid(cylinder(radius, 0.7, 48), Placement(centre, np.pi / 2, X_AXIS), turning, name=f"roller {side}")

    obstacles = (roller(-1), roller(1), *more.pop("obstacles", ()))
    return of_peers([body or block], steps, Friction(0.6, eps_v=1e-3), dt=0.02, obstacles=obstacles, **more)


def octopus(vertices: int = 400, gap: float = 0.14, cases: str = str(PEERS.parent / "cases")) -> Scene:
    """The octopus of the shared cases is drawn through the rollers, in the mesh that pdvol makes of it."""
    (level,) = build_levels(Scene((Body(f"{cases}/20-octopus/octopus.obj", JELLY, (vertices,)),), dt=0.02, steps=1))
    body = Body((solid(level.points, level.cells),), JELLY, name="octopus", placement=Placement((0.0, 0.38, 0.0)))
    return rollers(gap, steps=40, body=body, obstacles=(Plane((0.0, -0.72, 0.0), (0.0, 1.0, 0.0), name="floor"),))


SCENES = {
    "stack": stack,
    "rollers": rollers,
    "octopus": octopus,
    "octopus_2": lambda **other: octopus(3500, **other),
    "jelly_bowl": jelly_bowl,
    "balls": balls,
    "plates": plates,
    "struck_15": lambda **other: struck(15.0, **other),
    "struck_50": lambda **other: struck(50.0, **other),
}
"""Functions by name."""


def scene(name: str = "stack", **other) -> Scene:
    """One of `SCENES`, with what its function takes, by the model that earlier commits have, too."""
    return first_order(named(SCENES, name, **other))


if __name__ == "__main__":
    pdvol.main(scene)
