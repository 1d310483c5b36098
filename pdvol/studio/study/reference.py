"""How far a run is from a reference, in what users see: distances, bodies, contacts, volume, energy, outcome."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import body_sizes, lumped_masses
from pdvol.geometry.rigid_motions import drift, rigid_motions
from pdvol.levels.hierarchy import Hierarchy
from pdvol.measure.metrics import distance, elsewhere
from pdvol.runs.stored_fields import stored_densities
from pdvol.store.reader import Run, RunLevel

MOST_TIMES = 100  # states that are compared: more do not change a mean over time visibly
COMMON_TIME = 1e-6  # fraction of a step: times that are nearer are one time


class ReferenceStates:
    """The reference's states on its finest level, and the way there from all coarser ones.

    Parameters
    ----------
    run : the reference
    level : the level that counts
    """

    def __init__(self, run: Run, level: int):
        meshes = [stored.mesh for stored in run.levels[: level + 1]]
        self._hierarchy = Hierarchy(meshes, MPI.COMM_SELF, run.info.get("prolongation", "barycentric"))
        self.run, self.level = run, run.levels[level]
        self.masses = lumped_masses(self.level.mesh, stored_densities(run)[level])
        self.sizes = body_sizes(self.level.mesh)
        self._volume = self._states_volume(self.level)

    @property
    def duration(self) -> float:
        """Of the reference [s]."""
        return (self.level.steps - 1) * self.run.dt

    def positions(self, run: Run, level: int, time: float) -> np.ndarray:
        """(n, d) [m] of a run's level on the reference's mesh; linear in time between stored states."""
        stored = run.levels[level]
        fraction = time / run.dt
        step = int(np.floor(fraction + COMMON_TIME))
        fraction = max(fraction - step, 0.0)
        found = stored.positions(step)
        if fraction > COMMON_TIME:
            found = (1.0 - fraction) * found + fraction * stored.positions(step + 1)
        return self._hierarchy.prolong(found, level, self.level.index)

    def errors(self, run: Run, level: int) -> dict[str, Any]:
        """The errors of a run's level, see docs/study.md.

        Returns
        -------
        dict
            `end`, `time` [m]: root mean square distance over the mass, at the end and over all times; `worst` [m]: of
            any vertex at any time; `share`: `end` in sizes of the smallest body; `bodies`: of each its name, distance
            of the centres [m] and angle [degrees], at the end and the largest; `first_contact` [s], how much later;
            `volume`, relative, and `energy` [J], kinetic, elastic and of loads, at the end; `min_gap` [m]; `drift` [m],
            the largest distance of a body's centre from where level 0 of the same run has it, at the end; `outcome`.

        Raises
        ------
        InputError
            The meshes are not the reference's, or states are missing.
        """
        mine = run.levels[level]
        if mine.rest.shape[0] != len(self._hierarchy.meshes[level].points):
            raise InputError(f"{run.path}: level {level} is another mesh than the reference's")
        theirs, bodies = self.level, self.level.mesh.point_bodies
        times = self._times(run, mine)
        rms, worst, moved, turned = [], 0.0, [], []
        for time in times:
            a, b = self.positions(run, level, time), self.positions(self.run, theirs.index, time)
            rms.append(distance(a, b, self.masses))
            worst = max(worst, float(np.linalg.norm(a - b, axis=1).max()))
            one, other = (rigid_motions(theirs.rest, x, self.masses, bodies) for x in (a, b))
            apart, angle = drift(one, other)
            moved.append(apart)
            turned.append(angle)
        size = float(self.sizes.min())
        found: dict[str, Any] = {
            "end": rms[-1],
            "time": float(np.sqrt(np.mean(np.square(rms)))),
            "worst": worst,
            "share": rms[-1] / size,
            "bodies": [
                {
                    "name": name,
                    "centre": float(moved[-1][i]),
                    "centre_most": float(max(m[i] for m in moved)),
                    "angle": float(turned[-1][i]),
                    "angle_most": float(max(t[i] for t in turned)),
                }
                for i, name in enumerate(run.info["bodies"])
            ],
        }
        contacts = [_first_contact(x) for x in (mine, theirs)]
        found["first_contact"] = None if None in contacts else contacts[0] - contacts[1]  # type: ignore[operator]
        found["volume"] = self._states_volume(mine) / self._volume - 1.0
        found["energy"] = _energy(run, mine) - _energy(self.run, theirs)
        gaps = [record["min_gap"] for record in mine.log if record.get("min_gap") is not None]
        found["min_gap"] = min(gaps, default=None)
        found["drift"] = self._drift(run, level, float(times[-1])) if level and run.levels[0].steps else None
        found["outcome"] = not elsewhere(moved[-1], turned[-1], self.sizes).any()
        return found

    def _drift(self, run: Run, level: int, time: float) -> float:
        """[m] largest distance of a body's centre on a level from where level 0 of the same run has it."""
        mine, coarsest = (
            rigid_motions(self.level.rest, self.positions(run, index, time), self.masses, self.level.mesh.point_bodies)
            for index in (level, 0)
        )
        return float(drift(mine, coarsest)[0].max())

    def apart(self, one: tuple[Run, int], other: tuple[Run, int]) -> tuple[float, float]:
        """[m] root mean square distance of two runs' levels on the reference's mesh, at the end and over time."""
        times = self._times(one[0], one[0].levels[one[1]], other)
        found = [distance(self.positions(*one, t), self.positions(*other, t), self.masses) for t in times]
        return found[-1], float(np.sqrt(np.mean(np.square(found))))

    def _times(self, run: Run, level: RunLevel, other: tuple[Run, int] | None = None) -> np.ndarray:
        """Times [s] of the longer steps that both have, without the start."""
        dts, ends = [run.dt], [(level.steps - 1) * run.dt]
        their, theirs = (self.run, self.level) if other is None else (other[0], other[0].levels[other[1]])
        dts.append(their.dt)
        ends.append((theirs.steps - 1) * their.dt)
        dt, end = max(dts), min(ends) + COMMON_TIME * min(dts)
        count = int(end / dt + COMMON_TIME)
        if count < 1:
            raise InputError(f"{run.path}: level {level.index} has no step to compare")
        steps = np.unique(np.linspace(1, count, min(count, MOST_TIMES)).round().astype(int))
        return np.array([step * dt for step in steps])

    def _states_volume(self, level: RunLevel) -> float:
        """[m^d] of a level's last state."""
        mesh = level.mesh
        return float(type(mesh)(level.positions(level.steps - 1), mesh.cells, mesh.bodies, mesh.regions).volumes.sum())


def _first_contact(level: RunLevel) -> float | None:
    """[s] when anything touches first; None where nothing does."""
    return next((float(record["time"]) for record in level.log if record.get("contacts")), None)


def _energy(run: Run, level: RunLevel) -> float:
    """[J] kinetic, elastic and of loads, at the end."""
    last: Sequence[dict] = [record for record in level.log if record.get("energy")]
    potential = sum(last[-1]["energy"].get(name, 0.0) for name in ("elastic", "load")) if last else 0.0
    densities = stored_densities(run)[level.index]
    speed = level.velocities(level.steps - 1)
    return float(potential + 0.5 * lumped_masses(level.mesh, densities) @ (speed**2).sum(axis=1))


def cost(run: Run, levels: Sequence[int]) -> dict[str, float]:
    """What levels of a run took: `cpu` seconds of the steps, `newton` and `linear` iterations, `memory` [MB]."""
    log = [record for level in levels for record in run.levels[level].log]
    return {
        "cpu": sum(record["seconds"].get("cpu", record["seconds"]["total"]) for record in log),
        "newton": sum(record["newton_iterations"] for record in log),
        "linear": sum(record["linear_iterations"] for record in log),
        "memory": max((record["peak_memory_mb"] for record in log), default=0.0),
    }
