"""The scenes that pdvol is measured on, each as the peers ran it (`shared/peers/README.md`); a scene file like any
other.

    ./run pdvol run benchmarks/common/scenes/peers.py --set name=twist_1k

SI units, y up. Every scene: dt = 0.01 s, Neo-Hookean E = 2e5 Pa, nu = 0.4, 1000 kg/m^3, dhat = 1e-3 m, eps_v = 1e-3
m/s, and a tolerance of 1e-3 m/s: Newton stops when its full step is nowhere faster, which is what STARK's step
tolerance and IPC's 1e-5 m per step of 0.01 s mean.
"""

import sys
from pathlib import Path

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, NeoHookean, Rotation, Scene, Solid, Solver, Support
from pdvol.meshes import brick

sys.path.append(str(Path(__file__).resolve().parents[3]))  # as a scene file it is no part of a package

from benchmarks.common.scenes import ORIGIN, X_AXIS, falling, first_order, named, solid

PEERS = Path(__file__).resolve().parents[4] / "shared" / "peers"
MATERIAL = NeoHookean(2e5, poisson=0.4, density=1000.0)
BARRIER = Barrier(dhat=1e-3)
SOLVER = Solver(tolerance=1e-3)
RUB = Friction(0.3, eps_v=1e-3)
BAR = (1.0, 0.25, 0.25)
"""Sides of the bar that is twisted [m]."""
SIDE = 1e-6
"""Metres within which a vertex belongs to an end face."""


# ---- meshes


def peer_mesh(peers: Path, name: str) -> Solid:
    """A mesh of the peers, with the offsets of its scene, in its own vertex order."""
    with np.load(Path(peers) / f"{name}.npz") as arrays:
        return solid(arrays["V"], arrays["T"])


# ---- scenes


def of_peers(bodies, steps: int, *frictions: Friction, **more) -> Scene:
    """A scene with the peers' gravity, floor, contact distance, tolerance and time step."""
    return falling(bodies, steps, **{"contact": (BARRIER, *frictions), "solver": SOLVER, **more})


def drop(peers: Path, mesh: str) -> Scene:
    """A sphere of radius 0.5 m, its centre 0.8 m above the ground, falls."""
    return of_peers([Body((peer_mesh(peers, mesh),), MATERIAL)], 100, RUB)


def blocks(peers: Path) -> Scene:
    """Two cubes of 0.5 m, the lower one 2 mm above the ground, the upper one 0.1 m above the lower."""
    bodies = tuple(Body((peer_mesh(peers, f"block_{name}_2k"),), MATERIAL, name=name) for name in ("lo", "hi"))
    return of_peers(bodies, 60, Friction(0.5, eps_v=1e-3))


def twist(mesh: Solid, speed: float, steps: int = 100) -> Scene:
    """A bar of 1 x 0.25 x 0.25 m along x, its ends turned by +speed (at x = -0.5 m) and -speed [deg/s].

    The scene has a barrier although nothing touches at 72 deg/s. The guarantee that nothing crosses is part of the
    cost, as it is for the peers.
    """
    turn = np.radians(speed)
    ends = (
        Support(lambda X: X[:, 0] < -0.5 + SIDE, motion=Rotation(turn, ORIGIN, X_AXIS)),
        Support(lambda X: X[:, 0] > 0.5 - SIDE, motion=Rotation(-turn, ORIGIN, X_AXIS)),
    )
    return of_peers([Body((mesh,), MATERIAL)], steps, supports=ends, loads=(), obstacles=())


def impact(peers: Path, speed: float) -> Scene:
    """A ball of radius 0.1 m, 0.05 m above the middle of a 1 x 1 x 0.1 m slab held at its rim, thrown down at `speed`
    [m/s].

    The slab's upper side is at y = 0. There is nothing below it and no friction, so only contact keeps the ball from
    coming out underneath.
    """
    ball, slab = peer_mesh(peers, "drop_500"), brick((1.0, 0.1, 1.0), (20, 3, 20))
    ball = solid(0.2 * (ball.vertices - [0.0, 0.8, 0.0]) + [0.0, 0.15, 0.0], ball.cells)
    slab = solid(slab.vertices - [0.0, 0.05, 0.0], slab.cells)
    rim = Support(lambda X: np.abs(X[:, [0, 2]]).max(axis=1) > 0.5 - SIDE, body="slab")
    thrown = Body((ball,), MATERIAL, name="ball", velocity=(0.0, -float(speed), 0.0))
    return of_peers([thrown, Body((slab,), MATERIAL, name="slab")], 20, supports=(rim,), obstacles=())


SCENES = {
    **{f"drop_{size}": lambda peers, size=size: drop(peers, f"drop_{size}") for size in ("500", "4k", "20k")},
    **{
        f"twist_{size}": lambda peers, size=size: twist(peer_mesh(peers, f"twist_{size}"), 72.0)
        for size in ("1k", "4k", "20k")
    },
    "twistx_1k": lambda peers: twist(peer_mesh(peers, "twist_1k"), 360.0),
    "blocks": blocks,
    **{f"impact_{speed}": lambda peers, speed=speed: impact(peers, speed) for speed in (45, 100, 150)},
    # 99,900, 297,689 and 987,136 vertices (1.7 and 5.7 million tetrahedra)
    "twist_100k": lambda peers: twist(brick(BAR, (110, 29, 29)), 72.0, 5),
    "twist_300k": lambda peers: twist(brick(BAR, (160, 42, 42)), 72.0, 5),
    "twist_1m": lambda peers: twist(brick(BAR, (240, 63, 63)), 72.0, 10),
}
"""Functions of the peers' folder, by name, in the order in which they are run."""


def scene(name: str = "drop_500", peers: str = str(PEERS)) -> Scene:
    """One of `SCENES`, by the model that the peers have; `peers` is the folder of the peers' meshes."""
    return first_order(named(SCENES, name, Path(peers)))


if __name__ == "__main__":
    pdvol.main(scene)
