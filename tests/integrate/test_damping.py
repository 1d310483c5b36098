"""A stretched body that is damped returns in a few damping times, whatever its stretch and Poisson's ratio."""

import numpy as np
import pytest

import pdvol
from pdvol import Body, NeoHookean, Scene, meshes

DAMPING, DT = 0.1, 0.01


@pytest.mark.parametrize(
    ("stretch", "poisson", "integrator"),
    [
        (0.4, 0.0, "implicit_euler"),
        (0.4, 0.499, "bdf2"),
        (0.7, 0.3, "bdf2"),
        (1.1, 0.49, "implicit_euler"),
        (2.5, 0.0, "bdf2"),
        (2.5, 0.499, "implicit_euler"),
    ],
)
def test_a_stretch_that_keeps_its_volume_relaxes(poisson, stretch, integrator):
    """Inertia is negligible. Where strains are small, the stretch decays by 1 / e in one damping time."""
    start = np.array([stretch, stretch**-0.5, stretch**-0.5])
    material = NeoHookean(1e6, poisson, 10.0, damping=DAMPING)
    block = Body((meshes.brick((0.1,) * 3, (2,) * 3),), material, start=lambda X: X * start)
    scene = Scene((block,), dt=DT, steps=int(4 * DAMPING / DT), integrator=integrator)
    for step in pdvol.march(scene, levels=0):
        X, x = np.asarray(step.model.mesh.points), step.positions
        F = np.linalg.lstsq(X - X.mean(axis=0), x - x.mean(axis=0), rcond=None)[0]
        stretches = np.linalg.svd(F, compute_uv=False)
        left = (stretches[0 if stretch > 1.0 else 2] - 1.0) / (stretch - 1.0)
        if left < np.exp(-1.0):
            break
    assert 1.0 <= step.time / DAMPING <= 3.0
