"""Stiff materials stand for nearly rigid bodies: 2e10 Pa beside 2e4 Pa in one scene, with the solver's default
settings.
"""

import numpy as np
import pytest

from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.scene import Barrier, FixedCorotational, Friction, NeoHookean, Solver, StVenantKirchhoff
from problems import block, ground, make_scene, make_stepper, march, weight
from shapes import together


@pytest.mark.parametrize(("d", "law"), [(2, StVenantKirchhoff), (2, FixedCorotational), (3, NeoHookean)])
def test_a_rigid_block_thrown_on_a_soft_one(d, law):
    """It sinks in and keeps its shape: strains of a stress of about rho g h, 2e3 Pa, over 2e10 Pa, ten thousand times
    those of the soft one.
    """
    soft = block((0.0,) * (d - 1) + (0.005,), (0.6,) * (d - 1) + (0.205,), (4,) * (d - 1) + (2,), jitter=0.05)
    hard = block((0.2,) * (d - 1) + (0.215,), (0.4,) * (d - 1) + (0.415,), 2, jitter=0.05, seed=1)
    mesh = together(soft, hard)
    scene = make_scene(
        (law(2e4), law(2e10)),
        loads=(weight(d),),
        obstacles=ground(d)[:1],
        contact=(Barrier(dhat=4e-3), Friction(0.3)),
        solver=Solver(tolerance=1e-3),
    )
    thrown = mesh.point_bodies == 1
    velocity = np.where(thrown[:, None], [0.5] + [0.0] * (d - 2) + [-1.0], 0.0)
    for report in march(make_stepper(scene, mesh), 15, velocity=velocity):
        assert report.cuts == 0 and report.newton_iterations < 60
    x = report.positions
    assert report.contacts > 0 and x[thrown, -1].min() < 0.2
    strains = []
    for body in (soft, hard):
        mine = x[thrown] if body is hard else x[~thrown]
        F = np.einsum("kia,kij->kaj", mine[body.cells], body.hat_gradients)
        strains.append(np.abs(np.einsum("kai,kaj->kij", F, F) - np.eye(d)).max() / 2)
    assert strains[0] > 0.05 and strains[1] < 1e-5


@pytest.mark.parametrize("law", [NeoHookean, StVenantKirchhoff, FixedCorotational])
def test_every_law_survives_a_hard_impact(law):
    """rho v^2 = 3.2 E: cells are pressed to less than a tenth of their volume where the law gives way, none inverts and
    no step is cut.
    """
    mesh = block((0.0, 0.02), (0.4, 0.42), 4, jitter=0.1)
    scene = make_scene(
        (law(2e4),), obstacles=ground(2)[:1], contact=(Barrier(dhat=5e-3),), solver=Solver(tolerance=1e-3)
    )
    velocity, least = np.tile([0.0, -8.0], (len(mesh.points), 1)), 1.0
    for report in march(make_stepper(scene, mesh), 15, velocity=velocity):
        least = min(least, (simplex_volumes(report.positions, mesh.cells) / mesh.volumes).min())
        assert report.cuts == 0
    assert 0.0 < least < (0.5 if law is NeoHookean else 0.15)
    assert report.velocity[:, 1].mean() > 0.0, "it bounces"
