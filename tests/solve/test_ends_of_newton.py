"""Newton must not stop deep inside a barrier. Its steps are short there, although the solution is still far away."""

import numpy as np
import pytest

from pdvol.meshes import Outline
from pdvol.scene import Barrier, Plane, Rigid, Solver
from problems import block, make_scene, make_stepper, polyline, take_step

DHAT = 0.01


@pytest.mark.parametrize("obstacle", ["plane", "surface"])
@pytest.mark.parametrize("gap", [1e-4, 1e-7, 1e-10])
def test_a_body_deep_inside_a_barrier_comes_out(obstacle, gap):
    """A block at rest is a millionth of dhat or less away from the surface that pushes it. The step ends where the
    forces balance, not where it began.
    """
    corners = np.array([(-1.0, -0.5), (1.0, -0.5), (1.0, 0.0), (-1.0, 0.0)])
    floor, geometry = (
        (Plane((0.0, 0.0), (0.0, 1.0)), ()) if obstacle == "plane" else (Rigid(Outline(corners)), (polyline(corners),))
    )
    scene = make_scene(dt=0.01, obstacles=(floor,), contact=(Barrier(dhat=DHAT),), solver=Solver(tolerance=1e-3))
    mesh = block((0.0, gap * DHAT), (0.4, 0.4 + gap * DHAT), 2)
    problem = make_stepper(scene, mesh, geometry)
    report = take_step(problem, 1, mesh.points, np.zeros_like(mesh.points))
    assert report.min_gap > 0.05 * DHAT
    assert report.gradient_norm < 1e-3 * 0.01 * problem.potential.mass.max()
