"""Two scenes of benchmarks.fronts, of soft cubes of 0.2 m; a scene file. SI units, z up."""

import sys
from pathlib import Path

import numpy as np

import pdvol
from pdvol import Body, Gravity, NeoHookean, Placement, Plane, Scene, meshes

sys.path.append(str(Path(__file__).resolve().parents[2]))  # as a scene file it is no part of a package

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
    shape, plane = (
        tuple(meshes.brick((SIDE, SIDE, SIDE), (n, n, n)) for n in cuts),
        Plane((0.0,) * 3, (0.0, 0.0, 1.0), name=name),
    )
    bodies = (Body(shape, SOFT, name=name, placement=place) for name, place in places.items())
    return falling(bodies, 100, mu=mu, loads=(load,), obstacles=(plane,))


SCENES = {"sliding_block": sliding_block, "tower": tower}


def scene(name: str = "tower", **other) -> Scene:
    """One of `SCENES`, with what its function takes."""
    return named(SCENES, name, **other)


if __name__ == "__main__":
    pdvol.main(scene)
