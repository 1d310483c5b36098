"""Densities of a stored run's cells, as its description has them: no scene file is loaded."""

import numpy as np

from pdvol.store.reader import Run


def described_densities(run: Run) -> tuple[list[np.ndarray], str]:
    """(m,) [kg/m^d] of each level's cells, from the description of the run's bodies, and what that leaves out: empty
    where it says all. Without a description densities are 1.
    """
    note = ""
    try:
        described = run.info["description"]["bodies"]
        bodies = np.array([float(body["material"]["density"]) for body in described])
        if any(body.get("regions") for body in described):
            note = "without the scene, masses are those of the bodies' materials outside their regions"
    except (KeyError, TypeError):
        note = "the run does not say its bodies' densities: masses are volumes"
        bodies = np.ones(len(run.info["bodies"]))
    return [bodies[level.bodies] for level in run.levels], note
