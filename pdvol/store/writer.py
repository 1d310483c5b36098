"""Writing a run folder, by one process. A kill at any instant leaves whole states only.

`pdvol.store.folder` has the folder's layout.
"""

import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from pdvol.errors import InputError, SimulationError
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.store.files import TEMPORARY, append, jsonable, sync_file, write_array, write_arrays, write_json
from pdvol.store.folder import (
    LEVEL_STATES,
    RUN_FORMAT,
    claim,
    hold,
    keep_late,
    late_file,
    level_folder,
    read_info,
    run_state,
)
from pdvol.store.log import log_line, write_known
from pdvol.store.reader import Run
from pdvol.store.states import OldStates, States


class RunWriter:
    """Writes a run folder. Made by `create` or `open`; closed by `close` or a `with` block. It locks the folder: only
    one process can have it.

    Attributes
    ----------
    info : dict
        The content of `run.json`; it is changed through `update_info` and `set_level_state`.
    """

    def __init__(self, path: Path, held: TextIO):
        self.path, self._lock = path, held
        self.info: dict = {}
        self._states: list[States] = []  # by level
        self._count: list[int] = []  # of states, by level

    @classmethod
    def create(
        cls,
        path: str | Path,
        info: Mapping,
        meshes: Sequence[LevelMesh],
        body_names: Sequence[str],
        velocities: Sequence[np.ndarray] | None = None,
        replace: bool = False,
    ) -> "RunWriter":
        """Start a run in a new or empty folder.

        Parameters
        ----------
        path : folder; its parents are made
        info : at least `dt` [s], `steps`; JSON's types, numpy numbers and dataclasses of them
        meshes : one per level, coarsest first
        body_names : the name of each body index
        velocities : initial velocities (n, d) [m/s] per level; all at rest when None
        replace : remove a run that the folder holds

        Raises
        ------
        InputError
            When the folder holds something else, a run, or is being written.
        """
        path = Path(path)
        missing = [key for key in ("dt", "steps") if key not in info]
        if missing:
            raise InputError(f"a run needs {missing} in its info")
        # A folder that a kill leaves in the state "creating" has no step, and may be replaced.
        begun = {"format": RUN_FORMAT, "bodies": [str(name) for name in body_names], "levels": [], "state": "creating"}
        info = {**jsonable(info), **begun}
        writer = cls(path, claim(path, replace))
        try:
            writer.info = info
            writer._save()
            for mesh, velocity in zip(meshes, [None] * len(meshes) if velocities is None else velocities, strict=True):
                writer.add_level(mesh, velocity)
            writer._keep_log()
            writer._save_states()
        except BaseException:
            writer.close()
            raise
        return writer

    @classmethod
    def open(cls, path: str | Path) -> "RunWriter":
        """Go on with a stored run: left-overs of a kill are removed, and log lines without their state dropped. States
        of an older layout are converted.

        Raises
        ------
        InputError
            When it is no run of this format, damaged, or another process is writing it.
        """
        path = Path(path)
        read_info(path)
        writer = cls(path, hold(path))
        try:
            run = Run(path)
            writer.info = run.info
            for aside in path.rglob(f".*{TEMPORARY}"):
                aside.unlink()
            for level in run.levels:
                states = States(level.folder, level.rest.shape)
                if isinstance(level.states, OldStates):
                    states.extend(level.states.read, level.states.count())
                writer._states.append(states)
                writer._count.append(states.repair())
                keep_late(level.folder, writer._count[-1])
            writer.info["format"] = RUN_FORMAT
            writer._keep_log()
            writer._interrupt()  # this process has the lock: no other one writes
            writer._save_states()
            for level in run.levels:
                OldStates(level.folder, level.rest.shape).remove()  # also those that a kill left
        except BaseException:
            writer.close()
            raise
        return writer

    def steps(self, level: int) -> int:
        """How many states of a level are stored, step 0 included."""
        return self._count[level]

    def add_level(self, mesh: LevelMesh, velocity: np.ndarray | None = None) -> int:
        """Append a finer level, with its initial velocity (n, d) [m/s] (at rest when None); returns its index."""
        level, points = len(self.info["levels"]), np.asarray(mesh.points, dtype=np.float64)
        v = np.zeros_like(points) if velocity is None else np.ascontiguousarray(velocity, dtype=np.float64)
        if v.shape != points.shape:
            raise InputError(f"level {level}: the initial velocity has shape {v.shape}, the mesh {points.shape}")
        folder = level_folder(self.path, level)
        folder.mkdir(parents=True, exist_ok=True)
        states = States(folder, points.shape)
        states.create()
        places = {} if mesh.places is None else {"places": mesh.places}
        labels = {"bodies": mesh.bodies, "regions": mesh.regions}
        write_arrays(folder / "mesh.npz", points=points, cells=mesh.cells, **labels, **places)
        write_array(folder / "velocity.npy", v)
        sync_file(folder.parent)
        self._states.append(states)
        self._count.append(0)
        self.info["dimension"] = mesh.dim
        self.info["levels"].append({"vertices": len(points), "cells": len(mesh.cells), "state": "pending"})
        self._save()
        return level

    def write_state(self, level: int, step: int, positions: np.ndarray, record: Mapping | None = None) -> None:
        """Store the positions (n, d) [m] at the end of a step, and its log record just before them.

        The state is the commit: a record without its state is dropped when the run is opened again.

        Raises
        ------
        ValueError
            When the shape is wrong, numbers are not finite, or this is not the level's next step.
        SimulationError
            When the disk cannot be written.
        """
        shape = (self.info["levels"][level]["vertices"], self.info["dimension"])
        x = np.ascontiguousarray(positions, dtype=np.float64)
        if x.shape != shape or not np.isfinite(x).all():
            raise ValueError(
                f"level {level}, step {step}: positions must be finite and of shape {shape}, these have {x.shape}"
            )
        if step != self._count[level]:
            raise ValueError(f"level {level}: the next state to store is that of step {self._count[level]}, not {step}")
        if record is not None:
            append(self.path / "log.jsonl", log_line({"level": level, "step": step, **record}))
        self._states[level].write(step, x)
        self._count[level] = step + 1

    def write_late(self, level: int, step: int, places: Mapping[int, Mapping[str, np.ndarray]]) -> None:
        """Store where obstacles, by number, are at a level's step, if late; before `write_state` of that step."""
        arrays = {f"{i}.{key}": value for i, entry in places.items() for key, value in entry.items()}
        write_arrays(late_file(level_folder(self.path, level), step), **arrays)

    def keep_levels(self, count: int) -> None:
        """Remove all levels but the `count` coarsest, with their states, records and exports."""
        dropped = range(count, len(self.info["levels"]))
        if not dropped:
            return
        self.info["levels"] = self.info["levels"][:count]
        self._states, self._count = self._states[:count], self._count[:count]
        self._save_states()  # first: a folder without an entry does no harm
        for level in dropped:
            shutil.rmtree(level_folder(self.path, level), ignore_errors=True)
            for export in self.path.glob(f"level_{level}.*"):
                export.unlink()
        self._keep_log()

    def set_level_state(self, level: int, state: str, **details: Any) -> None:
        """Set a level's state, one of LEVEL_STATES, with details such as `reason`; the run's own state follows."""
        if state not in LEVEL_STATES:
            raise ValueError(f"state {state!r} must be one of {LEVEL_STATES}")
        self._states[level].sync()
        kept = {key: self.info["levels"][level][key] for key in ("vertices", "cells")}
        self.info["levels"][level] = {**kept, "state": state, **jsonable(details)}
        self._save_states()

    def update_info(self, **entries: Any) -> None:
        """Replace entries of `run.json`."""
        self.info.update(jsonable(entries))
        self._save()

    def close(self) -> None:
        """Release the lock. A level that was not finished is "interrupted"."""
        try:
            with suppress(SimulationError):  # the disk may be full: the next writer does it
                for states in self._states:
                    states.sync()
                if self._interrupt():
                    self._save_states()
        finally:
            self._lock.close()

    def __enter__(self) -> "RunWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _interrupt(self) -> bool:
        """Levels that nobody goes on with are "interrupted" from now on; whether there are any."""
        left = [entry for entry in self.info.get("levels", []) if entry["state"] == "running"]
        for entry in left:
            entry["state"] = "interrupted"
        return bool(left)

    def _save(self) -> None:
        write_json(self.path / "run.json", self.info)

    def _save_states(self) -> None:
        self.info["state"] = run_state(self.info["levels"])
        self._save()

    def _keep_log(self) -> None:
        """Drop the log's records whose state is not stored, and a torn last line."""
        write_known(self.path / "log.jsonl", self.path / "log.jsonl", dict(enumerate(self._count)))
