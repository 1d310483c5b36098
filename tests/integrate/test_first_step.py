"""The first step has the friction that its normal forces bear: those that a solve has found, not those of the scene's
gaps.
"""

import numpy as np
import pytest

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, Translation, meshes

MU, SIDE, DT = 0.3, 0.2, 0.005


def on_a_belt(d: int, gap: float, integrator: str, levels: int) -> Scene:
    """A block above a belt that moves at 1 m/s; dhat is 0.45 mm in 3D."""
    shapes = [
        meshes.brick((SIDE,) * 3, (n,) * 3) if d == 3 else meshes.rectangle(SIDE, SIDE) for n in range(2, 2 + levels)
    ]
    up, along = np.eye(d)[1], np.eye(d)[0]
    block = Body(
        tuple(shapes) if d == 3 else shapes[0],
        NeoHookean(1e6, 0.3, 500.0),
        () if d == 3 else tuple(20 * (level + 1) for level in range(levels)),
        name="block",
        placement=Placement(tuple((0.5 * SIDE + gap) * up)),
    )
    belt = Plane((0.0,) * d, tuple(up), motion=Translation(tuple(along)), name="belt")
    contact = (Barrier(dhat=4.5e-4), Friction(MU))
    loads = (Gravity(tuple(-9.81 * up)),)
    return Scene((block,), obstacles=(belt,), loads=loads, contact=contact, dt=DT, steps=1, integrator=integrator)


@pytest.mark.parametrize(
    ("d", "gap", "integrator", "levels"),
    [(2, 3e-4, "bdf2", 1), (2, 1e-5, "implicit_euler", 1), (3, 1e-4, "bdf2", 2), (3, 1e-5, "implicit_euler", 1)],
)
def test_friction_of_the_first_step_is_coulomb_s(d, gap, integrator, levels):
    """The barrier of the scene's gap alone would drag the block with up to forty times its weight. Finer levels begin
    likewise.
    """
    first = list(pdvol.march(on_a_belt(d, gap, integrator, levels)))
    assert [(step.level, step.step) for step in first] == [(level, 1) for level in range(levels)]
    for step in first:
        along, normal = (step.forces[name].sum(axis=0) for name in ("friction", "barrier"))
        assert normal[1] > 0.0
        assert along[0] == pytest.approx(MU * normal[1], rel=0.02)
