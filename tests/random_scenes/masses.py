"""Masses of a step, and its kinetic energy."""

import numpy as np

import pdvol
from pdvol.geometry.level_mesh import lumped_masses


def kinetic(step: pdvol.Step, velocity: np.ndarray) -> float:
    return 0.5 * float(masses_of(step) @ (velocity**2).sum(axis=1))


def masses_of(step: pdvol.Step) -> np.ndarray:
    return lumped_masses(step.model.mesh, step.model.materials.density)
