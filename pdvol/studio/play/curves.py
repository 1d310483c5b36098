"""The graphs under the time line: a level's energies, and its drift from the level below."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from pdvol.geometry.level_mesh import lumped_masses
from pdvol.geometry.rigid_motions import RigidMotions, drift, rigid_motions
from pdvol.store.reader import Run
from pdvol.store.series import described_densities

GRAPHS = {
    "energy": {"total": "kinetic + elastic + load", "kinetic": "kinetic", "elastic": "elastic", "load": "load"},
    "drift": {"centre": "of centres", "turn": "of orientations"},
}
"""By graph: the curves that it offers, with the words for them."""
UNITS = {"total": "J", "kinetic": "J", "elastic": "J", "load": "J", "centre": "m", "turn": "°"}
"""By curve."""


class Curves:
    """The curves of a run's levels, of all stored states; NaN where a value is not known.

    Masses are those of the bodies' materials, as the run describes them.

    Attributes
    ----------
    run : Run
    note : str
        What the masses leave out; empty where they are the scene's.
    """

    def __init__(self, run: Run):
        self.run = run
        self._densities, self.note = described_densities(run)
        self._motion = cache(self._motion_of)
        self._bodies = cache(self._bodies_of)

    def of_level(self, number: int, steps: Sequence[int]) -> dict[str, list[float]]:
        """By name of the curve: a value for each of these steps. A level without stored states below has no drift."""
        level = self.run.levels[number]
        masses = lumped_masses(level.mesh, self._densities[number])
        speeds = (level.velocities(step) for step in steps)
        kinetic = np.array([0.5 * masses @ (speed**2).sum(axis=1) for speed in speeds])
        found = {"kinetic": kinetic}
        logged = {record["step"]: record.get("energy") or {} for record in level.log}
        for name in ("elastic", "load"):
            values = [logged.get(step, {}).get(name) for step in steps]
            found[name] = np.array([np.nan if value is None else value for value in values], dtype=float)
        found["total"] = kinetic + found["elastic"] + found["load"]
        if number and self.run.levels[number - 1].steps:
            found |= self._drift(number, steps)
        return {name: [float(v) for v in values] for name, values in found.items() if not np.isnan(values).all()}

    def _drift(self, number: int, steps: Sequence[int]) -> dict[str, np.ndarray]:
        """The largest drift of a body since the start from the level below: of its centre of mass [m], and of its
        orientation [degrees]. Each level is fitted on its own mesh.
        """
        apart = np.full((2, len(steps)), np.nan)
        for place, step in enumerate(steps):
            if step < self.run.levels[number - 1].steps:
                mine, below = self._motion(number, step), self._motion(number - 1, step)
                apart[:, place] = [worst.max() for worst in drift(mine, below)]
        return dict(zip(GRAPHS["drift"], apart, strict=True))

    def _motion_of(self, number: int, step: int) -> RigidMotions:
        """Of a state of a level: the bodies' displacements since the start, and their rotations."""
        start, masses, bodies, centres = self._bodies(number)
        motion = rigid_motions(start, self.run.levels[number].positions(step), masses, bodies)
        return RigidMotions(motion.centres - centres, motion.rotations)

    def _bodies_of(self, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Of a level: the vertices at the start, their masses and bodies, and the bodies' centres at the start."""
        level = self.run.levels[number]
        start, masses, bodies = (
            level.positions(0),
            lumped_masses(level.mesh, self._densities[number]),
            level.mesh.point_bodies,
        )
        return start, masses, bodies, rigid_motions(start, start, masses, bodies).centres
