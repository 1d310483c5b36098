"""Fields of a stored run beside its states: of each step, on vertices and cells in the input's order; densities."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import vertex_strain
from pdvol.stages import say
from pdvol.store.reader import Run, RunLevel


@dataclass(frozen=True, eq=False)
class StepFields:
    """Fields of one step: `points` (n,) or (n, d) and `cells` (m,) by name."""

    points: Mapping[str, np.ndarray] = field(default_factory=dict)
    cells: Mapping[str, np.ndarray] = field(default_factory=dict)


Fields = Callable[[int], StepFields]
"""More fields of a level's steps, by step."""
LevelFields = Callable[[int], Fields]
"""More fields of a run's levels, by level."""


def nothing_more(step: int) -> StepFields:
    """The `Fields` of a level of which only the stored states are known."""
    return StepFields()


def with_strain(run: Run, fields: LevelFields) -> LevelFields:
    """The same fields and the vertices' `strain` (n,), which needs stored states alone."""

    def of_level(number: int) -> Fields:
        level, more = run.levels[number], fields(number)

        def at(step: int) -> StepFields:
            found = more(step)
            return StepFields({**found.points, "strain": vertex_strain(level.mesh, level.positions(step))}, found.cells)

        return at

    return of_level


class Series:
    """The stored steps of one level, as exports write them.

    Vectors have three components in 2D too, because ParaView warps by vectors of three only.

    Parameters
    ----------
    more : fields beside `displacement` [m], `velocity` [m/s], `body` and `region`

    Raises
    ------
    InputError
        When the level does not exist or has no state.
    """

    def __init__(self, run: Run, level: int, more: Fields = nothing_more):
        if not 0 <= level < len(run.levels):
            raise InputError(f"{run.path} has levels 0 to {len(run.levels) - 1}, not {level}")
        self.level: RunLevel = run.levels[level]
        self.dt, self.steps, self._more = run.dt, self.level.steps, more
        if self.steps == 0:
            raise InputError(f"{run.path}: level {level} has no stored state to export")

    @property
    def size(self) -> int:
        """Bytes that an HDF5 file of all steps takes at most: vectors of three, one cell field, and HDF5's own
        description of each array.
        """
        points, cells = len(self.level.rest), len(self.level.cells)
        return 2**16 + 8 * (3 * points + 5 * cells) + self.steps * (8 * (9 * points + cells) + 2**13)

    @property
    def labels(self) -> dict[str, np.ndarray]:
        """(m,) int32 of each cell: its `body` and its `region`, which determine its material."""
        return {"body": self.level.bodies, "region": self.level.regions}

    def say(self, step: int) -> None:
        """The stage that lasts says at which step the export is."""
        say(f"level {self.level.index}, step {step} of {self.steps - 1}")

    def displacement(self, step: int) -> np.ndarray:
        """(n, 3) [m]."""
        return in_3d(self.level.positions(step) - self.level.rest)

    def fields(self, step: int) -> StepFields:
        """All that changes from step to step."""
        self.say(step)
        more = self._more(step)
        points = {"displacement": self.displacement(step), "velocity": in_3d(self.level.velocities(step))}
        return StepFields({**points, **{name: in_3d(values) for name, values in more.points.items()}}, more.cells)


def in_3d(vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, d) with a zero third component in 2D, shape (n, 3)."""
    vectors = np.asarray(vectors)
    return np.hstack([vectors, np.zeros((len(vectors), 1))]) if vectors.shape[1] == 2 else vectors


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
