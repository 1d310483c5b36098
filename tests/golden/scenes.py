"""Four short shots on stored meshes, so that no mesher has a part in their numbers: `scene(shot="spike")` and so on."""

from pathlib import Path

import numpy as np

import pdvol
from pdvol import (
    Barrier,
    Body,
    FixedCorotational,
    Friction,
    Gravity,
    NeoHookean,
    Placement,
    Plane,
    Region,
    Rigid,
    Rotation,
    Scene,
    Solid,
    Support,
    Translation,
    meshes,
)
from pdvol import Path as Keyframes

STORED = np.load(Path(__file__).with_name("meshes.npz"))


def levels(name: str) -> tuple[Solid, ...]:
    """The stored levels of a shape, coarsest first."""
    return tuple(
        Solid(STORED[f"{name}_{i}_vertices"], STORED[f"{name}_{i}_cells"], STORED[f"{name}_{i}_regions"])
        for i in range(2)
    )


def spike() -> Scene:
    """The ball of demos/ball_on_spike.py, released nearer to the tip: two levels in 2D."""
    return Scene(
        bodies=(
            Body(
                levels("ball"), NeoHookean(3e4, 0.4, 1000.0), name="ball", placement=Placement(translate=(0.002, 0.78))
            ),
        ),
        obstacles=(
            Plane((0.0, 0.0), (0.0, 1.0), name="ground"),
            Rigid(meshes.spike(width=0.24, height=0.5), name="spike", placement=Placement(translate=(0.0, 0.002))),
        ),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(), Friction(0.3)),
        dt=0.01,
        steps=40,
    )


def drop() -> Scene:
    """Two bear cubs, one on a stone and one on the other: two levels in 3D, with friction, as in the paper by implicit
    Euler, with linear elements and without feedback.
    """
    cub = Body(
        levels("cub"), NeoHookean(5e4, 0.4, 1000.0), name="lower", placement=Placement(translate=(0.0, 0.08, 0.0))
    )
    upper = Body(
        levels("cub"),
        FixedCorotational(1e5, 0.35, 800.0),
        name="upper",
        spin=(0.0, 1.0, 2.0),
        velocity=(0.0, -2.0, 0.0),
        placement=Placement(translate=(0.05, 1.12, 0.02)),
    )
    return Scene(
        bodies=(cub, upper),
        obstacles=(
            Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="floor"),
            Rigid(meshes.ball(0.2, 2), name="stone", placement=Placement(translate=(0.0, -0.15, 0.0))),
        ),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(0.4, pairs={("lower", "floor"): 0.8})),
        dt=0.01,
        steps=30,
        integrator="implicit_euler",
        elements="linear",
        feedback=0.0,
    )


def driven() -> Scene:
    """A bar of two materials, wrung and let go at one end, met by a paddle on keyframes and a plane that rises."""
    ends = 0.5
    bar = Body(
        (meshes.brick((1.0, 0.2, 0.2), (10, 2, 2)),),
        NeoHookean(1e5, 0.4, 1000.0),
        name="bar",
        regions=(Region(NeoHookean(1e6, 0.3, 900.0, damping=0.01), lambda X: X[:, 0] > 0.2),),
    )
    return Scene(
        bodies=(bar,),
        supports=(
            Support(lambda X: X[:, 0] < 0.01 - ends, motion=Rotation(6.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
            Support(
                lambda X: X[:, 0] > ends - 0.01, motion=Rotation(-6.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), release=0.15
            ),
        ),
        obstacles=(
            Rigid(
                meshes.ball(0.15, 2),
                name="paddle",
                placement=Placement(translate=(0.0, 0.4, 0.0)),
                motion=Keyframes((0.0, 0.1, 0.25), ((0.0, 0.0, 0.0), (0.0, -0.2, 0.0), (0.1, -0.28, 0.0)), smooth=True),
            ),
            Plane((0.0, -0.24, 0.0), (0.0, 1.0, 0.0), motion=Translation((0.0, 0.25, 0.0)), name="lift"),
        ),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(0.2)),
        dt=0.01,
        steps=25,
    )


def scene(shot="spike") -> Scene:
    """One of the shots by name."""
    return {"spike": spike, "drop": drop, "driven": driven}[shot]()


if __name__ == "__main__":
    pdvol.main(scene)
