"""Soft and stiff together on a trampoline (paper, section 5, heterogeneous materials).

Is the bounce the same on all levels?

The bodies are a worm of 2e4 Pa, a propeller of 2e10 Pa, the letters A, B and C of 4e4, 5e5 and 6e6 Pa by three material
laws, and a ball of soft and firm panels.
"""

import numpy as np

import pdvol
import recipes
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
    Scene,
    Solver,
    StVenantKirchhoff,
    Support,
)

WIDTH, BED, LEG = 2.8, 0.7, 0.12  # m: the trampoline, the height of its bed, and its legs


def scene(vertices=(40, 100, 250, 600), drop=1.0, bounce=1e7, spin=0.0, mu=0.2, steps=140, dt=0.01):
    """All bodies fall from `drop` m and more on a bed of `bounce` Pa; the propeller turns at `spin` rad/s.

    `vertices` is the number for each body; the bed has twice as many. A spinning body as stiff as the propeller takes
    15 Newton iterations a step.
    """
    A, B, C = (recipes.letter(name, 0.5) for name in "ABC")
    low, high = BED + 0.25 + drop, BED + 0.95 + drop

    def thrown(name, shape, material, x, y, angle=0.0, **more):
        return Body(shape, material, tuple(vertices), name=name, placement=Placement((x, y), np.radians(angle)), **more)

    panels = (Region(NeoHookean(4e5, 0.4, 200.0), (1, 3, 5)),)
    return Scene(
        bodies=(
            Body(
                recipes.trampoline(WIDTH, BED, bed=0.05, leg=LEG),
                NeoHookean(bounce, 0.4, 500.0),
                tuple(2 * v for v in vertices),
                name="trampoline",
                placement=Placement((0.0, 0.02)),
            ),
            thrown("A", A, NeoHookean(4e4, 0.4, 400.0), -0.72, low, 6.0),
            thrown("B", B, StVenantKirchhoff(5e5, 0.4, 400.0), 0.0, low, -8.0),
            thrown("C", C, FixedCorotational(6e6, 0.4, 400.0), 0.70, low, 5.0),
            thrown("worm", recipes.worm(), NeoHookean(2e4, 0.4, 400.0), -0.45, high, 8.0),
            thrown("propeller", recipes.propeller(), NeoHookean(2e10, 0.3, 400.0), 0.55, high, spin=spin),
            thrown("ball", recipes.beach_ball(0.2), NeoHookean(4e4, 0.4, 200.0), 0.05, high + 0.55, regions=panels),
        ),
        supports=(Support(lambda X: np.abs(X[:, 0]) > WIDTH / 2 - LEG, body="trampoline"),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), name="ground"),),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(), Friction(mu)),
        solver=Solver(
            linear="direct"
        ),  # conjugate gradients need 37 iterations a solve on level 0: stiffnesses a million times apart
        dt=dt,
        steps=steps,
    )


def claim(run):
    """The bed gives way as far on all levels, and what is stiff keeps its shape."""
    bed, propeller = (run.info["bodies"].index(name) for name in ("trampoline", "propeller"))
    lowest, stretched = [], []
    for level in run.levels:
        owners, rest = level.mesh.point_bodies, level.rest
        middle, blades = (owners == bed) & (abs(rest[:, 0]) < 0.1), np.flatnonzero(owners == propeller)
        states = [level.positions(step) for step in range(level.steps)]
        lowest.append(min(x[middle, 1].mean() for x in states))
        lengths = np.array([np.linalg.norm(np.diff(x[blades], axis=0), axis=1) for x in (rest, *states)])
        stretched.append(abs(lengths / lengths[0] - 1.0).max())
    apart, shown = max(lowest) - min(lowest), ", ".join(f"{height:.3f}" for height in lowest)
    return [
        (f"The middle of the bed, at {BED} m, sinks to {shown} m on the levels.", max(lowest) < BED - 0.1),
        (f"These heights are within {1000 * apart:.0f} mm.", apart < 0.05),
        (f"No distance in the propeller changes by more than {max(stretched):.1e} of it.", max(stretched) < 1e-4),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
