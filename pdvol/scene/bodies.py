"""The deformable bodies, where they start and how fast."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np

from pdvol.errors import InputError
from pdvol.meshes import Outline, Solid, Surface
from pdvol.registry import ELEMENTS
from pdvol.scene.checks import (
    anything,
    choice,
    count,
    finite,
    function_or,
    instance,
    numbers,
    optional,
    plain,
    positive,
    require,
    sequence,
    several,
    takes,
    text,
    vector,
)
from pdvol.scene.element import NOT_SIMULATED, Element
from pdvol.scene.materials import Material, Region
from pdvol.scene.placement import Placement
from pdvol.scene.point_caches import Posed, TakeOver
from pdvol.scene.render_mesh import RenderMesh
from pdvol.scene.values import Vector

MOST_LEVELS, MOST_VERTICES = 32, 100_000_000  # numbers above these are typing errors
Shape: TypeAlias = str | Path | Outline | Surface | Solid


@dataclass(frozen=True, repr=False)
class Separate(Element):
    """What may be done to bodies that meet something at t = 0 on some level, instead of refusing the scene. It is
    reported.

    Attributes
    ----------
    by : "move" bodies apart, "shrink" them (both on all levels alike), or "refine": decimate less on the level where
        they meet
    limit : the most: a fraction of the body's diagonal, of its size, or of the level's vertices
    """

    by: str = "move"
    limit: float = 0.2

    checks = {"by": choice("move", "shrink", "refine"), "limit": positive}

    def __post_init__(self) -> None:
        super().__post_init__()
        require(
            self.limit < 1.0 or self.by != "shrink",
            f"Separate.limit = {self.limit!r} shrinks a body to nothing; give less than 1",
        )


def _starts_at(name: str, velocity: Any) -> None:
    if not isinstance(velocity, TakeOver):
        function_or(optional(vector, ()), "X")(name, velocity)


@dataclass(frozen=True, repr=False)
class Body(Element):
    """A deformable body.

    Attributes
    ----------
    shape : path of a surface or volume mesh, `Outline`, `Surface`, `Solid`, or a tuple of them, one per level. In a
        tuple, volume meshes are taken as they are and others are meshed to their targets
    material : Material, of what no region claims
    vertices : vertex targets, coarsest level first; may be left empty where `shape` lists volume meshes
    name : str
    placement : Placement
    start : where it is at t = 0, if not at rest: a function of rest positions (n, d) [m], as placed, that gives
        positions (n, d) [m]; or a `Posed`, a mesh with positions. The shape stays the one without stress.
    velocity : initial velocity [m/s]; a function of rest positions (n, d) that gives it (n, d); or a `TakeOver`
    spin : initial angular velocity [rad/s] about the body's centre of volume: a number in 2D, three in 3D
    regions : parts with materials of their own; later ones win where they overlap
    render : one or several `RenderMesh` that are drawn in its place; they do not change the simulation
    elements : "linear" or "smoothed"; the scene's where not given
    """

    shape: Shape | Sequence[Shape]
    material: Material
    vertices: Sequence[int] | np.ndarray = ()
    name: str = "body"
    placement: Placement = Placement()
    velocity: Vector | Callable[[np.ndarray], np.ndarray] | TakeOver = ()
    spin: float | Vector = ()
    regions: Sequence[Region] = ()
    render: RenderMesh | Sequence[RenderMesh] = field(default=(), metadata={NOT_SIMULATED: True})
    start: Callable[[np.ndarray], np.ndarray] | Posed | None = None
    elements: str | None = None

    whose = "body {name!r}: "
    files = ("shape",)
    checks = {
        "name": text,
        "shape": anything,
        "material": instance(Material),
        "vertices": sequence,
        "velocity": _starts_at,
        "spin": anything,
        "regions": several(Region, "Region(material, where)"),
        "elements": optional(choice(*ELEMENTS)),
    }

    def __post_init__(self) -> None:
        if isinstance(self.render, RenderMesh):
            object.__setattr__(self, "render", (self.render,))
        super().__post_init__()
        several(RenderMesh, "RenderMesh(shape)")(self._named("render"), self.render)
        self._check_levels()
        takes(self._named("start"), self.start, "X")
        require(
            self.start is None or callable(self.start) or isinstance(self.start, Posed),
            f"body {self.name!r}: start must be a function of rest positions (n, d) that gives positions (n, d), or a"
            f" Posed, which fit all levels, not {type(self.start).__name__}",
        )
        spin = self.spin if isinstance(self.spin, tuple) else (self.spin,)
        for value in spin:
            finite(self._named("spin"), value)
        require(len(spin) in (0, 1, 3), f"body {self.name!r}: spin = {spin!r} must have one component or three")

    def _check_levels(self) -> None:
        """That each level has a mesh or a number of vertices."""
        given = len(self.vertices)
        if isinstance(self.shape, tuple):
            require(self.levels > 0, f"body {self.name!r}: the list of meshes is empty")
            require(
                given in (0, self.levels),
                f"body {self.name!r}: {given} vertex targets for a list of {self.levels} meshes; give one"
                " a level, or none where all are volume meshes",
            )
        else:
            require(
                given > 0,
                f"body {self.name!r}: give vertices=(coarsest, ..., finest), one target per level; a volume mesh that"
                " is taken as it is stands in a tuple, one per level",
            )
        require(given <= MOST_LEVELS, f"body {self.name!r}: {given} vertex targets; {MOST_LEVELS} levels are the most")
        for v in self.vertices:
            require(
                isinstance(v, int) and 4 <= v <= MOST_VERTICES,
                f"body {self.name!r}: vertex target {v!r} is not a whole number from 4 to {MOST_VERTICES}",
            )
        require(
            list(self.vertices) == sorted(self.vertices),
            f"body {self.name!r}: vertex targets {self.vertices} must go from coarse to fine",
        )

    @property
    def levels(self) -> int:
        """How many levels this body has."""
        return len(self.shape) if isinstance(self.shape, tuple) else len(self.vertices)

    @property
    def render_meshes(self) -> tuple[RenderMesh, ...]:
        """What is drawn in its place; none where its own surface is."""
        return cast(tuple[RenderMesh, ...], tuple(self.render))  # type: ignore[arg-type]

    def instances(self, *placements: Placement) -> tuple["Body", ...]:
        """This body at each of several placements, named after it: they have its meshes, which are made once."""
        return tuple(
            replace(self, name=f"{self.name} {number}", placement=placement)
            for number, placement in enumerate(placements, 1)
        )

    @property
    def uniform(self) -> bool:
        """Whether all of the body is made of the same."""
        return not self.regions and not self.material.varies

    def initial_velocity(self, points: np.ndarray, centre: np.ndarray, start: np.ndarray | None = None) -> np.ndarray:
        """Velocity field [m/s] at rest positions `points` (n, d) of a body, without what it takes over from an
        animation. Its spin turns it about `centre` (d,), where it is at t = 0: at `start` (n, d), or else at rest.
        """
        dim = points.shape[1]
        v = velocities(self._named("velocity"), () if isinstance(self.velocity, TakeOver) else self.velocity, points)
        spin = np.ravel(np.asarray(self.spin, dtype=float))
        if spin.size:
            require(
                spin.size == (1 if dim == 2 else 3),
                f"body {self.name!r}: spin has {spin.size} components in a {dim}D scene",
            )
            r = (points if start is None else start) - centre
            v += spin[0] * np.column_stack([-r[:, 1], r[:, 0]]) if dim == 2 else np.cross(spin, r)
        return v


def velocities(name: str, velocity: Vector | Callable[[np.ndarray], np.ndarray], points: np.ndarray) -> np.ndarray:
    """(n, d) [m/s]: an initial velocity at rest positions `points` (n, d) [m], none where it is empty. Raises
    InputError, naming it, where it does not fit.
    """
    v, dim = np.zeros_like(points), points.shape[1]
    if callable(velocity):
        return v + numbers(name, velocity, (points,), points.shape)
    if len(velocity):
        require(len(velocity) == dim, f"{name} has {len(velocity)} components in a {dim}D scene")
        v += np.asarray(velocity, dtype=float)
    return v


@dataclass(frozen=True)
class Jittered:
    """An initial velocity with a small random one added, the same at all points.

    Attributes
    ----------
    velocity : as `Body.velocity`
    speed : of what is added [m/s]; its direction follows from the seed
    seed : tuple of whole numbers
    """

    velocity: Vector | Callable[[np.ndarray], np.ndarray]
    speed: float
    seed: tuple[int, ...]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """(n, d) [m/s] at `points` (n, d) [m]."""
        direction = np.random.default_rng(self.seed).normal(size=points.shape[1])
        return velocities("velocity", self.velocity, points) + self.speed * direction / np.linalg.norm(direction)


def jittered(bodies: Sequence[Body], jitter: Any) -> tuple[Body, ...]:
    """The bodies, each with a velocity of its own added, of random direction: how far the ends of such starts are apart
    shows how chaotic a scene is.

    A velocity is added, and no displacement, so that no body meets another one at the start.

    Parameters
    ----------
    jitter : pair (speed [m/s], seed)

    Raises
    ------
    InputError
        It is no such pair.
    """
    pair = plain(jitter)
    require(isinstance(pair, tuple) and len(pair) == 2, f"jitter = {pair!r} must be (speed in m/s, seed)")
    finite("the speed of jitter", pair[0], 0.0)
    count("the seed of jitter", pair[1], 0)
    moved = []
    for number, body in enumerate(bodies):
        if isinstance(body.velocity, TakeOver):
            raise InputError(f"jitter: body {body.name!r} takes its velocity over from an animation, and keeps it")
        moved.append(replace(body, velocity=Jittered(body.velocity, float(pair[0]), (pair[1], number))))
    return tuple(moved)
