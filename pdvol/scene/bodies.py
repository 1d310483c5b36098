"""The deformable bodies, where they start and how fast."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from pdvol.meshes import Outline, Solid, Surface
from pdvol.registry import ELEMENTS
from pdvol.scene.checks import called, finite, keep_plain, positive, require, sequence, takes, vector
from pdvol.scene.materials import Material, Region
from pdvol.scene.motions import Vector
from pdvol.scene.placement import Placement
from pdvol.scene.point_caches import TakeOver
from pdvol.scene.poses import Posed
from pdvol.scene.render_mesh import RenderMesh
from pdvol.scene.representation import NOT_SIMULATED, one_line

MOST_LEVELS, MOST_VERTICES = 32, 100_000_000  # numbers above these are typing errors
Shape: TypeAlias = str | Path | Outline | Surface | Solid


@dataclass(frozen=True)
class Separate:
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
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "limit")
        require(self.by in ("move", "shrink", "refine"), f"Separate.by = {self.by!r} must be move, shrink or refine")
        positive("Separate.limit", self.limit)
        require(
            self.limit < 1.0 or self.by != "shrink",
            f"Separate.limit = {self.limit!r} shrinks a body to nothing; give less than 1",
        )


@dataclass(frozen=True)
class Body:
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
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "shape", "vertices", "velocity", "spin", "regions")
        require(isinstance(self.name, str), f"the name of a body must be text, not {self.name!r}")
        require(
            self.elements is None or self.elements in ELEMENTS,
            f"body {self.name!r}: elements = {self.elements!r} must be {' or '.join(ELEMENTS)}",
        )
        listed = self._levels_listed()
        sequence(f"body {self.name!r}: vertices", self.vertices)
        require(
            isinstance(self.material, Material),
            f"body {self.name!r}: material must be a Material, not {type(self.material).__name__}",
        )
        sequence(f"body {self.name!r}: regions", self.regions)
        for region in self.regions:
            require(
                isinstance(region, Region),
                f"body {self.name!r}: regions hold Region(material, where), not {type(region).__name__}",
            )
        if isinstance(self.render, RenderMesh):
            object.__setattr__(self, "render", (self.render,))
        sequence(f"body {self.name!r}: render", self.render)
        for mesh in self.render_meshes:
            require(
                isinstance(mesh, RenderMesh),
                f"body {self.name!r}: render holds RenderMesh(shape), not {type(mesh).__name__}",
            )
        if listed:
            require(self.levels > 0, f"body {self.name!r}: the list of meshes is empty")
            require(
                len(self.vertices) in (0, self.levels),
                f"body {self.name!r}: {len(self.vertices)} vertex targets for a list of {self.levels} meshes; give one"
                " a level, or none where all are volume meshes",
            )
        else:
            require(
                len(self.vertices) > 0,
                f"body {self.name!r}: give vertices=(coarsest, ..., finest), one target per level",
            )
        if len(self.vertices):
            require(
                len(self.vertices) <= MOST_LEVELS,
                f"body {self.name!r}: {len(self.vertices)} vertex targets; {MOST_LEVELS} levels are the most",
            )
            for v in self.vertices:
                require(
                    isinstance(v, (int, np.integer)) and 4 <= v <= MOST_VERTICES,
                    f"body {self.name!r}: vertex target {v!r} is not a whole number from 4 to {MOST_VERTICES}",
                )
            require(
                list(self.vertices) == sorted(self.vertices),
                f"body {self.name!r}: vertex targets {self.vertices} must go from coarse to fine",
            )
        require(
            self.start is None or callable(self.start) or isinstance(self.start, Posed),
            f"body {self.name!r}: start must be a function of rest positions (n, d) that gives positions (n, d), or a"
            f" Posed, which fit all levels, not {type(self.start).__name__}",
        )
        takes(f"body {self.name!r}: start", self.start, "X")
        takes(f"body {self.name!r}: velocity", self.velocity, "X")
        if not callable(self.velocity) and not isinstance(self.velocity, TakeOver) and self.velocity != ():
            vector(f"body {self.name!r}: velocity", self.velocity)
        spin = self.spin if isinstance(self.spin, tuple) else (self.spin,)
        for value in spin:
            finite(f"body {self.name!r}: spin", value)
        require(len(spin) in (0, 1, 3), f"body {self.name!r}: spin = {spin!r} must have one component or three")

    @property
    def levels(self) -> int:
        """How many levels this body has."""
        return len(self.shape) if isinstance(self.shape, (tuple, list)) else len(self.vertices)

    def _levels_listed(self) -> bool:
        return isinstance(self.shape, (tuple, list))

    @property
    def render_meshes(self) -> tuple[RenderMesh, ...]:
        """What is drawn in its place; none where its own surface is."""
        return (self.render,) if isinstance(self.render, RenderMesh) else tuple(self.render)

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
        v = np.zeros_like(points)
        if isinstance(self.velocity, TakeOver):
            pass
        elif callable(self.velocity):
            field = called(f"body {self.name!r}: velocity", self.velocity, (points,), points.shape)
            require(bool(np.isfinite(field).all()), f"body {self.name!r}: velocity gives NaN or infinity")
            v += field
        elif len(self.velocity):
            require(
                len(self.velocity) == dim,
                f"body {self.name!r}: velocity has {len(self.velocity)} components in a {dim}D scene",
            )
            v += np.asarray(self.velocity, dtype=float)
        spin = np.ravel(np.asarray(self.spin, dtype=float))
        if spin.size:
            require(
                spin.size == (1 if dim == 2 else 3),
                f"body {self.name!r}: spin has {spin.size} components in a {dim}D scene",
            )
            r = (points if start is None else start) - centre
            v += spin[0] * np.column_stack([-r[:, 1], r[:, 0]]) if dim == 2 else np.cross(spin, r)
        return v
