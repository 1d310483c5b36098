"""Forces of every step balance, and contact gives the momentum that its forces have, in the step that it has them."""

import numpy as np
import pytest

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, Impulse, NeoHookean, Placement, Plane, Scene, Support, meshes
from pdvol.geometry.level_mesh import lumped_masses
from shapes import cut_block

G, RADIUS, DT, MU = 9.81, 0.1, 0.01, 0.1
STIFF = NeoHookean(1e8, 0.3, 1000.0)


@pytest.mark.parametrize(
    ("d", "mu", "integrator"),
    [(2, 0.0, "bdf2"), (2, 0.1, "implicit_euler"), (3, 0.0, "implicit_euler"), (3, 0.1, "bdf2")],
)
def test_a_heavy_stiff_block_at_rest_weighs_what_it_weighs(d, mu, integrator):
    """Its contact is so stiff that a step far below the tolerance changes the force by a tenth of the weight."""
    up = np.eye(d)[1]
    stiff = NeoHookean(1e10, 0.4, 1000.0)
    cube = Body((cut_block((1.0,) * d, (2,) * d),), stiff, name="cube", placement=Placement(tuple(0.501 * up)))
    flat = (2.0, 0.2, 2.0)[:d]
    pad = Body((cut_block(flat, (6, 1, 6)[:d]),), stiff, name="pad", placement=Placement(tuple(-0.1 * up)))
    scene = Scene(
        (cube, pad),
        supports=(Support(lambda X: X[:, 1] < -0.19, "pad"),),
        loads=(Gravity(tuple(-G * up)),),
        contact=(Barrier(), *((Friction(mu),) if mu else ())),
        dt=0.025,
        steps=40,
        integrator=integrator,
    )
    for step in pdvol.march(scene, levels=0):
        top = step.model.start[:, 1] > 0.0
        forces = {name: rows[top].sum(axis=0) for name, rows in step.forces.items()}
        left, largest = np.abs(sum(forces.values())).max(), max(np.abs(rows).max() for rows in forces.values())
        assert left <= 0.01 * largest
    weight = 1000.0 * G
    assert (forces["barrier"] + forces.get("friction", 0.0))[1] == pytest.approx(weight, rel=0.02)


def masses_of(step) -> np.ndarray:
    return lumped_masses(step.model.mesh, step.model.materials.density)


@pytest.mark.parametrize(
    ("d", "gap", "iterations", "integrator", "time"),
    [
        (2, 0.002, 1, "bdf2", None),
        (2, 0.035, 20, "implicit_euler", None),
        (3, 0.002, 20, "implicit_euler", None),
        (3, 0.035, 1, "bdf2", None),
        (2, 0.004, 1, "bdf2", 0.1),
        (2, 0.014, 20, "bdf2", 0.1),
        (3, 0.024, 1, "bdf2", 0.1),
    ],
)
def test_a_blow_counts_once_at_the_start_and_later(d, gap, iterations, integrator, time):
    """A ball, or a square in 2D, hits a floor in the first step, or in a later one, and slides; or in the step in which
    an impulse pushes it, in the next one or later. Both impulses of contact are its momentum's change, and Coulomb's
    law holds between them.
    """
    e, up = np.eye(d)[0], np.eye(d)[1]
    thrown = tuple(3.0 * e - up)
    shape = meshes.ball(RADIUS, 2) if d == 3 else meshes.rectangle(2.0 * RADIUS, 2.0 * RADIUS)
    place, velocity = Placement(tuple((RADIUS + gap) * up)), thrown if time is None else ()
    scene = Scene(
        (Body(shape, STIFF, (300 if d == 3 else 60,), name="ball", placement=place, velocity=velocity),),
        obstacles=(Plane((0.0,) * d, tuple(up)),),
        loads=() if time is None else (Impulse(thrown, time=time),),
        contact=(Barrier(), Friction(MU, iterations=iterations)),
        dt=DT,
        steps=20 if time is None else 25,
        integrator=integrator,
    )
    contact = dict.fromkeys(("barrier", "friction"), 0.0)  # N s
    for step in pdvol.march(scene, levels=0):
        for name in contact:
            contact[name] = contact[name] + DT * step.forces.get(name, np.zeros((1, 1))).sum(axis=0)
    mass = masses_of(step)
    change = mass @ step.velocity - mass.sum() * np.array(thrown)
    assert contact["barrier"][1] > 0.0
    assert change[1] == pytest.approx(contact["barrier"][1], rel=0.02)
    assert change[0] == pytest.approx(contact["friction"][0], rel=0.02)
    assert -change[0] / change[1] == pytest.approx(MU, rel=0.02)
