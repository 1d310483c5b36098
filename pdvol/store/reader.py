"""Reading a run folder: arrays in the input's vertex order, whatever the number of ranks that wrote them.

A run may be read while it is written. Errors name what is missing or damaged, and what is still usable.
"""

from collections.abc import Sequence
from contextlib import suppress
from functools import cache, cached_property, lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.store.files import lock, read_array, read_arrays, require_no_link_out
from pdvol.store.folder import OLD_FORMAT, RECORD, late_file, level_folder, read_info
from pdvol.store.log import read_log
from pdvol.store.obstacles import DrawnObstacle, read_obstacles
from pdvol.store.render_meshes import StoredRender, read_render_meshes, read_render_weights
from pdvol.store.states import OldStates, States

if TYPE_CHECKING:
    from mpi4py import MPI
    from scipy.sparse import csr_matrix

    from pdvol.compat import fem
    from pdvol.levels.space import LevelSpace
    from pdvol.scene import Hand

KEPT_STATES = 8  # states of a level that stay in memory: the forces at the end of a step look at six of the level below


class RunLevel:
    """One level of a stored run.

    Attributes
    ----------
    index : int
        0 is the coarsest level.
    info : dict
        Its entry in `run.json`: `state`, `vertices`, `cells` and what the writer added.
    """

    def __init__(self, run: "Run", index: int, info: dict):
        self.index, self.info = index, info
        self.folder = level_folder(run.path, index)
        self._run = run
        self._read = lru_cache(KEPT_STATES)(lambda step, stamp: self.states.read(step))
        self._weights = cache(partial(read_render_weights, self.folder))
        self._space: tuple[MPI.Comm, LevelSpace] | None = None

    def __repr__(self) -> str:
        vertices, cells, state = (self.info.get(key) for key in ("vertices", "cells", "state"))
        return f"RunLevel({self.index}, vertices={vertices}, cells={cells}, steps={self.steps}, {state})"

    @cached_property
    def mesh(self) -> LevelMesh:
        """The level's mesh at rest."""
        path = self.folder / "mesh.npz"
        try:
            arrays = read_arrays(path, ("points", "cells", "bodies", "regions"))
        except InputError as error:
            raise InputError(f"{error}: level {self.index} cannot be used, the other levels can") from error
        points, cells, bodies, regions = (arrays[key] for key in ("points", "cells", "bodies", "regions"))
        sound = (
            points.ndim == 2 and points.shape[1] in (2, 3) and points.dtype == np.float64 and np.isfinite(points).all()
        )
        if (
            not sound
            or cells.size == 0
            or not _numbers(cells, (*cells.shape[:1], points.shape[1] + 1), len(points))
            or not all(_numbers(labels, cells.shape[:1], 2**31) for labels in (bodies, regions))
        ):
            raise InputError(
                f"{path} does not hold a mesh of triangles (2D) or tetrahedra (3D): level {self.index} cannot be used"
            )
        places = arrays.get("places")
        if places is not None and (places.shape != points.shape or not np.isfinite(places).all()):
            raise InputError(f"{path} does not hold a place of each vertex: level {self.index} cannot be used")
        return LevelMesh(points, cells, bodies, regions, places)

    @property
    def rest(self) -> np.ndarray:
        """(n, d) float64 [m]: rest positions."""
        return self.mesh.points

    @property
    def cells(self) -> np.ndarray:
        """(m, d + 1) int64."""
        return self.mesh.cells

    @property
    def bodies(self) -> np.ndarray:
        """(m,) int32: the body of each cell; `run.info["bodies"]` names them."""
        return self.mesh.bodies

    @property
    def regions(self) -> np.ndarray:
        """(m,) int32: the region of each cell within its body."""
        return self.mesh.regions

    @property
    def surface(self) -> np.ndarray:
        """(k, d) int64: boundary facets, outward."""
        return self.mesh.boundary

    @cached_property
    def states(self) -> States | OldStates:
        """The level's states as they are stored."""
        layout = OldStates if self._run.info["format"] == OLD_FORMAT else States
        return layout(self.folder, self.rest.shape)

    @property
    def steps(self) -> int:
        """How many whole states there are, step 0 included. Grows while the run is written."""
        return self.states.count()

    def positions(self, step: int) -> np.ndarray:
        """(n, d) float64 [m]: positions at the end of `step`; step 0 is the start.

        Raises
        ------
        InputError
            When that state is not there or damaged; the message names the usable states.
        """
        stamp = self.states.stamp(step)
        if stamp is None:
            raise InputError(f"{self.folder}: there is no step {step}; {self._usable()}")
        try:
            return self._read(step, stamp).copy()
        except InputError as error:
            raise InputError(f"{error}; {self._usable(step)}") from error

    def _usable(self, damaged: int | None = None) -> str:
        """The states that are there, without one whose numbers are damaged."""
        last = self.steps - 1
        spans = [(0, last)] if damaged is None or damaged > last else [(0, damaged - 1), (damaged + 1, last)]
        named = [f"{a} to {b}" if a < b else str(a) for a, b in spans if a <= b]
        return f"usable states of level {self.index}: {', '.join(named) or 'none'}"

    def velocities(self, step: int) -> np.ndarray:
        """(n, d) float64 [m/s]: mean velocity over `step`, the scene's initial velocity for step 0."""
        if step == 0:
            return self._start_velocity.copy()
        return (self.positions(step) - self.positions(step - 1)) / self._run.dt

    @cached_property
    def _start_velocity(self) -> np.ndarray:
        return read_array(self.folder / "velocity.npy", self.rest.shape)

    def space(self, comm: "MPI.Comm | None" = None) -> "LevelSpace":
        """The level at rest in dolfinx: `space.domain` is its mesh, `space.V` vector P1 on it, and `space.function` and
        `space.cell_function` make fields of arrays in the input's order. The first call for a communicator is
        collective.

        Parameters
        ----------
        comm : ranks that hold a part of the mesh each; the world when None
        """
        from mpi4py import MPI

        from pdvol.levels.space import LevelSpace  # loads dolfinx, which arrays do not need

        comm = MPI.COMM_WORLD if comm is None else comm
        if self._space is None or self._space[0] != comm:
            self._space = comm, LevelSpace(self.mesh, comm)
        return self._space[1]

    def displacement(self, step: int, comm: "MPI.Comm | None" = None) -> "fem.Function":
        """The displacement [m] from rest at the end of a step, a `dolfinx.fem.Function` on `space(comm).V`. Collective.

        Raises
        ------
        InputError
            As for `positions`.
        """
        return self.space(comm).function(self.positions(step) - self.rest, "displacement")

    def placed(self, obstacles: Sequence[DrawnObstacle], step: int) -> tuple[DrawnObstacle, ...]:
        """The run's obstacles at a step: where a hand has shifted them, or contact held them back on this level."""
        path, hand = late_file(self.folder, step), self._run.hand
        if not path.exists():
            by = hand.line(step)["obstacles"] if hand else {}
            at = lambda o: o.held({"vertices": o.vertices(step) + by[o.name]})
            return tuple(at(o) if o.name in by and "vertices" in o.arrays else o for o in obstacles)
        arrays = read_arrays(path, ())
        late = [
            {key.partition(".")[2]: value for key, value in arrays.items() if key.partition(".")[0] == str(i)}
            for i in range(len(obstacles))
        ]
        return tuple(o.held(found) if found else o for o, found in zip(obstacles, late, strict=True))

    def render_weights(self, mesh: StoredRender) -> "csr_matrix":
        """W (n, vertices of the level): positions of a render mesh of the run are W x, its velocities W v."""
        return self._weights(mesh.index, len(self.rest))

    def lateness(self, step: int) -> tuple[float, dict[str, float]]:
        """[s] how far motions were behind at the end of a step, at most; and where not all were as far, each one that
        was behind, by its name in the log.
        """
        record = self.record(step)
        return record.get("behind", 0.0), record.get("late", {})

    @property
    def log(self) -> list[dict]:
        """The log's records of this level."""
        return list(self._run.records().get(self.index, {}).values())

    def record(self, step: int) -> dict:
        """The log's record of a step; empty where there is none."""
        return self._run.records().get(self.index, {}).get(step, {})


def _numbers(array: np.ndarray, shape: tuple, end: int) -> bool:
    """Whether an array holds whole numbers below `end`, none negative, in this shape."""
    return array.shape == shape and array.dtype.kind in "iu" and bool(array.min() >= 0 and array.max() < end)


class Run:
    """A stored run, as `open_run` gives it.

    Attributes
    ----------
    path : Path
    info : dict
        `run.json`: scene, dt [s], steps, method, parameters, versions, bodies, levels, state.
    levels : sequence of RunLevel
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self._log: tuple[tuple[int, int] | None, dict[int, dict[int, dict]]] = None, {}
        self.info = read_info(self.path)
        require_no_link_out(self.path)
        if self.info.get("state") == "creating":
            raise InputError(f"{self.path}: the run was interrupted before its first step; start it again")
        if not self.info["levels"]:
            raise InputError(f"{self.path / 'run.json'} names no level; put back the file as pdvol wrote it")
        self.levels: Sequence[RunLevel] = tuple(RunLevel(self, i, entry) for i, entry in enumerate(self.info["levels"]))

    def __repr__(self) -> str:
        levels = [level.info.get("vertices") for level in self.levels]
        return f"Run({str(self.path)!r}, vertices={levels}, {self.info.get('state')})"

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return float(self.info["dt"])

    def records(self) -> dict[int, dict[int, dict]]:
        """The log's records by level and step, read anew where the file has changed."""
        path, stamp = self.path / "log.jsonl", (0, 0)
        with suppress(OSError):
            found = path.stat()
            stamp = found.st_mtime_ns, found.st_size
        if self._log[0] != stamp:
            records: dict[int, dict[int, dict]] = {}
            for record in read_log(path):
                if "level" in record and "step" in record:
                    records.setdefault(record["level"], {})[record["step"]] = record
            self._log = stamp, records
        return self._log[1]

    @cached_property
    def hand(self) -> "Hand | None":
        """The record of its hand; None of a run without one."""
        if "hand" not in self.info:
            return None
        from pdvol.scene import Hand

        return Hand(self.path / RECORD)

    @cached_property
    def obstacles(self) -> tuple[DrawnObstacle, ...]:
        """The obstacles as stored for pictures."""
        return read_obstacles(self.path)

    @cached_property
    def render_meshes(self) -> tuple[StoredRender, ...]:
        """What is drawn in the place of bodies."""
        return read_render_meshes(self.path, len(self.info.get("bodies", ())))

    def play(self, width: int = 960, height: int = 640, **choices: Any) -> Any:
        """The run in a player, which a notebook shows; `choices` are those of `pdvol.studio.play.notebook.play`."""
        from pdvol.registry import STUDIO  # reading states needs nothing of it

        return STUDIO["play"](self, width, height, **choices)

    @property
    def in_use(self) -> bool:
        """Whether a process is writing this run now."""
        try:
            held = lock(self.path / "run.lock", exclusive=False)
        except OSError:  # no lock file, or none that can be opened: no writer can be found
            return False
        if held:
            held.close()
        return held is None


def open_run(path: str | Path) -> Run:
    """Open a stored run for reading, also while it is being written. Arrays are read when they are needed.

    Parameters
    ----------
    path : folder of the run

    Raises
    ------
    InputError
        When the folder is no run, was never completed at its creation, or has another format.
    """
    return Run(path)
