"""The stored runs of the thrown ape, and its heights."""

from pathlib import Path

import numpy as np

from benchmarks.common.process import REPOSITORY
from pdvol import open_run
from pdvol.geometry.level_mesh import lumped_masses
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import load_shot
from pdvol.store.reader import Run

DT = 0.01
"""Time step of the swinging bar and the thrown ape [s]."""
TRUE_DT = 0.0025
"""Time step of what they are compared with [s]: BDF2's error is a sixteenth of that at `DT`."""
KINDS = {
    f"{time}, {space}": {"integrator": integrator, "elements": space, "feedback": 0.0}
    for time, integrator in (("implicit Euler", "implicit_euler"), ("BDF2", "bdf2"))
    for space in ("linear", "smoothed")
}
APE, FINEST, STEPS = REPOSITORY / "demos" / "ape.py", 3, 80
"""The demo, its finest level and its steps of `DT`."""


def stored(out: Path, method: str = "progressive", first: int = 0, **settings: object) -> Run:
    """The run of levels `first` to `FINEST` with settings of the scene, from `out` where it is finished there."""
    steps = round(STEPS * load_shot(APE).scene.dt / load_shot(APE, settings).scene.dt)
    words = "_".join(str(value) for value in settings.values())
    folder = out / f"ape_{method}_{first}_{FINEST}_{words}"
    shot = load_shot(APE, settings, steps)
    there = (folder / "run.json").exists()
    run_scene(shot, folder, first, FINEST, method, resume=there, how=Execution(xdmf=False))
    return open_run(folder)


def rises(run: Run, level: int) -> np.ndarray:
    """(states,): how far the centre of all bodies has risen along z since t = 0 [m]."""
    stored_level = run.levels[level]
    volumes = lumped_masses(stored_level.mesh, np.ones(len(stored_level.cells)))
    heights = [volumes @ stored_level.positions(step)[:, 2] / volumes.sum() for step in range(stored_level.steps)]
    return np.array(heights) - heights[0]
