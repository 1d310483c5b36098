"""Small scenes with extreme parameters: the stability envelope. A scene file like any other.

    ./run pdvol run benchmarks/extremes/scenes.py --set name=young_1e2

Most are `stack`: two cubes of 125 vertices, the upper one thrown askew onto the lower one, with friction, on a floor.
SI units, y up. What a row does not vary is pdvol's default, or E = 1e5 Pa, nu = 0.4, 1000 kg/m^3, a cube of
1 m, dt = 0.01 s.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import pdvol
from pdvol import (
    Barrier,
    Body,
    Friction,
    Gravity,
    NeoHookean,
    Placement,
    Plane,
    Relative,
    Rigid,
    Rotation,
    Scene,
    Support,
    Translation,
)
from pdvol.meshes import ball, brick

sys.path.append(str(Path(__file__).resolve().parents[2]))  # as a scene file it is no part of a package

from benchmarks.common.scenes import FLOOR, ORIGIN, X_AXIS, falling, grid, named

GRAVITY = 9.81
SOFT = NeoHookean(1e5)
SKEW = (1.0, 0.4, 0.6)
"""Axis about which what falls is turned, so that nothing meets corner to corner or face to face by construction."""
DHAT = Relative(1e-3)
"""Contact distance of most scenes."""


def stack(
    lower: NeoHookean = SOFT,
    upper: NeoHookean | None = None,
    size: float = 1.0,
    dt: float = 0.01,
    steps: int = 60,
    dhat: float | Relative = DHAT,
    mu: float = 0.3,
    speed: float = 3.0,
) -> Scene:
    """A cube on the floor and another thrown onto it: `size` [m], `speed` [m/s] at 1 m (Froude's for other sizes)."""
    cube, speed = brick((size, size, size), (4, 4, 4)), speed * np.sqrt(size)
    gap = size * 1e-3 + 1.1 * (dhat if isinstance(dhat, float) else 0.0)
    top = Placement((0.05 * size, 1.9 * size + 2 * gap, 0.03 * size), 0.5, SKEW)
    bodies = (
        Body((cube,), lower, name="lower", placement=Placement((0.0, 0.5 * size + gap, 0.0))),
        Body((cube,), upper or lower, name="upper", placement=top, velocity=(0.0, -speed, 0.0)),
    )
    return falling(bodies, steps, dt, contact=(Barrier(dhat), Friction(mu)))


def thrown(speed: float, dt: float = 0.01, steps: int = 40, size: float = 0.2) -> Scene:
    """A cube of `size` [m], E = 1e6 Pa, thrown askew at the floor at `speed` [m/s]."""
    cube, above = brick((size, size, size), (4, 4, 4)), Placement((0.0, size, 0.0), 0.5, SKEW)
    velocity = (0.3 * speed, -speed, 0.1 * speed)
    return falling([Body((cube,), NeoHookean(1e6), placement=above, velocity=velocity)], steps, dt, 0.3)


def spinning(spin: float, integrator: str = "implicit_euler", dt: float = 0.01, steps: int = 200) -> Scene:
    """A free cube of 0.2 m, E = 1e8 Pa, that turns with `spin` [rad/s] about a diagonal, a principal axis of its lumped
    masses (a cube's cells are not symmetric about its sides' normals, about which it would tumble).
    """
    cube = Body((brick((0.2, 0.2, 0.2), (3, 3, 3)),), NeoHookean(1e8), spin=(spin / np.sqrt(3.0),) * 3)
    return Scene((cube,), dt=dt, steps=steps, integrator=integrator)


SLOPE, HOLD = 0.3, 0.5
"""Tangent of a slope, and the coefficient of friction that holds a cube there."""


def on_a_slope(steps: int = 300) -> Scene:
    """A cube of 0.2 m, E = 1e6 Pa, put on a slope that friction holds it on. The first axis points downhill."""
    angle = np.arctan(SLOPE)
    down = Gravity((GRAVITY * np.sin(angle), -GRAVITY * np.cos(angle), 0.0))
    cube = Body((brick((0.2, 0.2, 0.2), (3, 3, 3)),), NeoHookean(1e6), placement=Placement((0.0, 0.1003, 0.0)))
    return falling([cube], steps, mu=HOLD, loads=(down,))


def shot_at_a_sheet(speed: float, dt: float = 0.01, steps: int = 20) -> Scene:
    """The same cube thrown at a sheet of 1 m, one cell of 2 cm thick, held at its rim, with nothing behind it."""
    solid, above = brick((0.2, 0.2, 0.2), (3, 3, 3)), Placement((0.02, 0.2, 0.03), 0.5, SKEW)
    cube = Body((solid,), NeoHookean(1e6), name="cube", placement=above, velocity=(0.0, -float(speed), 0.0))
    sheet = Body((brick((1.0, 0.02, 1.0), (10, 1, 10)),), NeoHookean(1e6), name="sheet")
    rim = Support(lambda X: np.abs(X[:, [0, 2]]).max(axis=1) > 0.499, body="sheet")
    return falling([cube, sheet], steps, dt, obstacles=(), supports=(rim,))


def slide(mu: float) -> Scene:
    """A slab thrown along the floor at 3 m/s."""
    slab, above = brick((1.0, 0.3, 1.0), (6, 2, 6)), Placement((0.0, 0.152, 0.0))
    return falling([Body((slab,), SOFT, placement=above, velocity=(3.0, 0.0, 1.0))], 60, mu=mu)


def compress(fraction: float, poisson: float = 0.4, steps: int = 60) -> Scene:
    """A cube of 1 m between two plates that close by `fraction` of its height, over 1.2 s."""
    gap, dt = 2e-3, 0.02
    close = (2 * gap + fraction) / (dt * steps)
    top = Plane((0.0, 0.5 + gap, 0.0), (0.0, -1.0, 0.0), Translation((0.0, -close, 0.0)), "top")
    bottom = Plane((0.0, -0.5 - gap, 0.0), (0.0, 1.0, 0.0), name="bottom")
    cube = Body((brick((1.0, 1.0, 1.0), (4, 4, 4)),), NeoHookean(1e5, poisson))
    return Scene((cube,), dt=dt, steps=steps, obstacles=(top, bottom), contact=(Barrier(),))


def twist(turns: float, cuts=(40, 2, 2), dt: float = 0.04, steps: int = 250) -> Scene:
    """A bar of 1 x 0.1 x 0.1 m, one end turned against the other by so many full turns."""
    bar = Body((brick((1.0, 0.1, 0.1), cuts),), SOFT)
    speed = np.pi * turns / (dt * steps)
    ends = tuple(
        Support(lambda X, s=side: s * X[:, 0] > 0.499, motion=Rotation(side * speed, ORIGIN, X_AXIS))
        for side in (-1, 1)
    )
    return Scene((bar,), dt=dt, steps=steps, supports=ends, contact=(Barrier(),))


def thin(cuts, size, dhat: float, dt: float = 0.01, steps: int = 60) -> Scene:
    """A block of extreme cells, dropped askew."""
    above = Placement((0.0, 0.6, 0.0), 0.3, SKEW)
    block = Body((brick(size, cuts),), NeoHookean(1e6), placement=above, velocity=(0.0, -3.0, 0.0))
    return falling([block], steps, dt, contact=(Barrier(dhat), Friction(0.3)))


def drape(cuts=(14, 1, 14), dt: float = 0.01, steps: int = 80) -> Scene:
    """A sheet, one cell of 1 cm thick, falls on a ball and the floor."""
    sheet = Body((brick((1.0, 0.01, 1.0), cuts),), SOFT, placement=Placement((0.05, 0.62, 0.02), 0.2, SKEW))
    below = Rigid(ball(0.25, 2), Placement((0.0, 0.26, 0.0)), name="ball")
    return falling([sheet], steps, dt, 0.3, obstacles=(FLOOR, below))


def shaken(speed: float) -> Scene:
    """Two cubes, every vertex thrown in a direction of its own with a normally distributed speed [m/s]."""
    scene = stack()

    def velocity(X: np.ndarray) -> np.ndarray:
        return speed * np.random.default_rng(len(X)).normal(size=X.shape)

    return replace(scene, bodies=tuple(replace(body, velocity=velocity) for body in scene.bodies))


def levels(cuts, size, dt: float, steps: int) -> Scene:
    """A bar of several levels falls askew across a ball onto the floor."""
    bar = Body(tuple(brick(size, three) for three in cuts), SOFT, placement=Placement((0.1, 0.8, 0.0), 0.2, SKEW))
    below = Rigid(ball(0.2, 2), Placement((0.0, 0.25, 0.0)), name="ball")
    return falling([bar], steps, dt, 0.3, obstacles=(FLOOR, below))


def flat_levels(dt: float = 0.04, steps: int = 40) -> Scene:
    """The same in the plane: a bar of eight levels onto a floor and a ball, 20 to 765 vertices."""
    cuts = ((9, 1), (10, 2), (15, 2), (19, 3), (24, 4), (30, 6), (40, 8), (84, 8))
    bar = Body(tuple(grid((1.0, 0.2), two, (-0.5, -0.1)) for two in cuts), SOFT, placement=Placement((0.1, 0.9), 0.3))
    below = Rigid(pdvol.meshes.disc(0.2, 48), Placement((0.0, 0.25)), name="ball")
    obstacles = (Plane((0.0, 0.0), (0.0, 1.0), name="floor"), below)
    return falling([bar], steps, dt, 0.3, loads=(Gravity((0.0, -GRAVITY)),), obstacles=obstacles)


def powers(first: int, last: int) -> list[str]:
    """Names of powers of ten, such as `1e2` to `1e11`."""
    return [f"1e{k}" for k in range(first, last + 1)]


LIGHT, HEAVY = NeoHookean(1e8, density=10.0), NeoHookean(1e8, density=1e7)
SIZES = {"1mm": 1e-3, "1cm": 1e-2, "10cm": 0.1, "1m": 1.0, "10m": 10.0, "100m": 100.0, "1km": 1000.0}
EIGHT = [(3, 1, 1), (4, 1, 1), (6, 1, 1), (6, 2, 2), (8, 2, 2), (10, 3, 3), (14, 3, 3), (18, 4, 4)]
SCENES = {
    "young_1e2": lambda: stack(NeoHookean(1e2), steps=30),
    **{f"young_{e}": lambda e=e: stack(NeoHookean(float(e))) for e in powers(3, 11)},
    "stiffness_ratio_1e10_soft_below": lambda: stack(NeoHookean(1e2), NeoHookean(1e12), size=0.01, dt=1e-3),
    "stiffness_ratio_1e10_soft_above": lambda: stack(NeoHookean(1e12), NeoHookean(1e2), size=0.01, dt=1e-3),
    **{f"poisson_{nu}": lambda nu=nu: stack(NeoHookean(1e5, nu)) for nu in (0.0, 0.3, 0.45, 0.49, 0.499)},
    **{f"dt_{dt}": lambda dt=dt: stack(dt=float(dt)) for dt in ("1e-5", "1e-4", "1e-3", "0.01", "0.04", "0.1")},
    "dt_1e-5_touching": lambda: replace(thrown(30.0, dt=1e-5), steps=200),
    **{f"impact_{speed}": lambda speed=speed: thrown(speed) for speed in (1, 10, 100, 1000, 10000)},
    "impact_1000_dt_1e-4": lambda: thrown(1000, dt=1e-4, steps=60),
    **{f"impact_sheet_{speed}": lambda speed=speed: shot_at_a_sheet(speed) for speed in (10, 100)},
    "impact_sheet_1000": lambda: shot_at_a_sheet(1000, steps=3),
    "impact_sheet_1000_dt_1e-4": lambda: shot_at_a_sheet(1000, dt=1e-4, steps=40),
    **{f"dhat_1e{k}": lambda k=k: stack(dhat=10.0**k, steps=60 if k > -6 else 30) for k in range(-6, 0)},
    "dhat_2.5_sizes": lambda: replace(thrown(3.0), contact=(Barrier(0.5), Friction(0.3))),
    **{f"mu_{mu}": lambda mu=mu: slide(mu) for mu in (0, 0.1, 1, 10)},
    "slope_sticks": on_a_slope,
    "mass_ratio_1e6_heavy_above": lambda: stack(LIGHT, HEAVY, size=0.1),
    "mass_ratio_1e6_heavy_below": lambda: stack(HEAVY, LIGHT, size=0.1),
    "compress_50": lambda: compress(0.5),
    "compress_90": lambda: compress(0.9),
    "compress_99": lambda: compress(0.99),
    "compress_99_poisson_0": lambda: compress(0.99, 0.0),
    "compress_90_poisson_0.499": lambda: compress(0.9, 0.499),
    "twist_2_turns": lambda: twist(2, steps=60),
    "twist_20_turns": lambda: twist(20),
    "twist_20_turns_one_cell_thick": lambda: twist(20, (30, 1, 1)),
    **{f"spin_{speed}": lambda speed=speed: spinning(float(speed)) for speed in (2, 30, 1000)},
    "spin_2_bdf2": lambda: spinning(2.0, "bdf2"),
    "spin_30_bdf2": lambda: spinning(30.0, "bdf2"),
    **{
        f"size_0.1mm_thrown_dt_{dt}": lambda dt=dt: thrown(2.0, float(dt), size=1e-4) for dt in ("1e-5", "1e-4", "0.01")
    },
    **{
        f"size_{word}": lambda size=size: stack(NeoHookean(1e7), size=size, dt=0.01 * np.sqrt(size))
        for word, size in SIZES.items()
    },
    "aspect_1e3_plates": lambda: thin((8, 1, 8), (1.0, 0.125e-3, 1.0), 5e-5),
    "aspect_1e3_layers": lambda: thin((6, 3, 6), (0.6, 0.3e-3, 0.6), 1e-4),
    "aspect_1e3_needles": lambda: thin((1, 5, 5), (0.6, 3e-3, 3e-3), 5e-4),
    "sheet_thinner_than_dhat": lambda: thin((6, 1, 6), (0.6, 0.3e-3, 0.6), 9e-4, steps=20),
    "sheet_one_cell_thick": drape,
    **{f"random_velocities_{speed}": lambda speed=speed: shaken(float(speed)) for speed in (1, 10, 100)},
    "levels_8_dt_0.04": lambda: levels(EIGHT, (1.0, 0.2, 0.2), 0.04, 40),
    "levels_8_flat_dt_0.04": flat_levels,
    "levels_from_20_vertices": lambda: levels([(4, 1, 1), (6, 2, 2), (10, 3, 3)], (1.0, 0.2, 0.2), 0.01, 80),
}
"""Functions by name, in the order of the table."""


def scene(name: str = "young_1e5") -> Scene:
    """One of `SCENES`."""
    return named(SCENES, name)


if __name__ == "__main__":
    pdvol.main(scene)
