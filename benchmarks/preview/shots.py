"""The shots of the study, and their stored runs by the old and the new defaults."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.common.process import REPOSITORY
from pdvol import open_run
from pdvol.geometry.level_mesh import lumped_masses
from pdvol.geometry.rigid_motions import drift, rigid_motions
from pdvol.levels.hierarchy import Hierarchy
from pdvol.measure import metrics
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot
from pdvol.store.reader import Run, RunLevel

DT = 0.01
"""Time step of the swinging bar and the thrown ape [s]."""
TRUE_DT = 0.0025
"""Time step of what they are compared with [s]: BDF2's error is a sixteenth of that at `DT`."""
KINDS = {
    f"{time}, {space}": {"integrator": integrator, "elements": space, "feedback": 0.0}
    for time, integrator in (("implicit Euler", "implicit_euler"), ("BDF2", "bdf2"))
    for space in ("linear", "smoothed")
}
DEFAULTS: Mapping[str, Mapping[str, object]] = {
    "old": KINDS["implicit Euler, linear"],
    "new, no feedback": KINDS["BDF2, smoothed"],
    "new": {**KINDS["BDF2, smoothed"], "feedback": 0.05},
}


@dataclass(frozen=True)
class Shot:
    """A demo, and how much of it is run.

    Attributes
    ----------
    demo : file name without its ending
    finest : level
    steps : of the scene's time step
    settings : of the scene
    body : whose distances are measured; of all when empty
    """

    demo: str
    finest: int
    steps: int
    settings: Mapping[str, Any] = field(default_factory=dict)
    body: str = ""


SHOTS = {
    "ape": Shot("ape", 3, 80),
    "noodles": Shot("bunny_noodles", 2, 70, {"slices": 3}),
    "leaf_sheep": Shot("leaf_sheep", 1, 30, body="plant"),
    "rope": Shot("rope_drop", 4, 150),
    "twist": Shot("twist", 1, 100),
    "spike": Shot("ball_on_spike", 4, 120),
    "drop": Shot("drop", 1, 100),
    "jelly_bowl": Shot("jelly_bowl", 1, 30),
}


def demo(name: str) -> Path:
    """The scene file of a shot."""
    return REPOSITORY / "demos" / f"{SHOTS[name].demo}.py"


def stored(
    out: Path, name: str, method: str = "progressive", levels: tuple[int, int] | None = None, **settings: object
) -> Run:
    """The run of a shot with settings of its scene, from the folder `out` where it is finished there.

    Parameters
    ----------
    levels : first and last; from 0 to the shot's finest one when None
    """
    shot = SHOTS[name]
    first, last = (0, shot.finest) if levels is None else levels
    file, own = demo(name), {**shot.settings, **settings}
    steps = round(shot.steps * load_shot(file, shot.settings).scene.dt / load_shot(file, own).scene.dt)
    loaded = load_shot(file, own, steps)
    words = "_".join(str(value) for value in settings.values())
    folder = out / "_".join((name, method, str(first), str(last), words))
    run_scene(loaded, folder, first, last, method, resume=(folder / "run.json").exists(), xdmf=False)
    return open_run(folder)


def rises(run: Run, level: int) -> np.ndarray:
    """(states, 2): how far the centre of all bodies, and the highest point, have risen along z since t = 0 [m]."""
    mesh = run.levels[level].mesh
    volumes = lumped_masses(mesh, np.ones(len(mesh.cells)))
    heights = np.array([(volumes @ x[:, 2] / volumes.sum(), x[:, 2].max()) for x in states(run.levels[level])])
    return heights - heights[0]


def states(level: RunLevel) -> Iterator[np.ndarray]:
    """Positions (n, d) [m] of each stored state."""
    return (level.positions(step) for step in range(level.steps))


def from_level_0(run: Run, body: str = "") -> dict[int, np.ndarray]:
    """level -> (states,) root mean square distance [m] of a body, or of all, from level 0, over the volume."""
    hierarchy = Hierarchy([level.mesh for level in run.levels], MPI.COMM_SELF)
    found = {}
    for level in run.levels[1:]:
        volumes = lumped_masses(level.mesh, np.ones(len(level.cells)))
        if body:
            volumes = volumes * (level.mesh.point_bodies == run.info["bodies"].index(body))
        pairs = zip(states(level), states(run.levels[0]), strict=True)
        found[level.index] = np.array(
            [metrics.distance(x, hierarchy.prolong(x_0, 0, level.index), volumes) for x, x_0 in pairs]
        )
    return found


def drifts(run: Run) -> dict[int, np.ndarray]:
    """level -> (states, 2): how far the centre of the body that has drifted furthest is from level 0 [m], and how far
    the one that has turned most is turned against it [degrees].
    """
    hierarchy = Hierarchy([level.mesh for level in run.levels], MPI.COMM_SELF)
    found = {}
    for level in run.levels[1:]:
        volumes = lumped_masses(level.mesh, np.ones(len(level.cells)))
        rows = []
        for x, x_0 in zip(states(level), states(run.levels[0]), strict=True):
            lifted = hierarchy.prolong(x_0, 0, level.index)
            motions = (rigid_motions(level.rest, y, volumes, level.mesh.point_bodies) for y in (x, lifted))
            rows.append([values.max() for values in drift(*motions)])
        found[level.index] = np.array(rows)
    return found
